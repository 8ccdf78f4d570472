#pragma once
#include "trochoid/model/dormand_prince_tableau.hpp"
#include "trochoid/model/dual.hpp"
#include "trochoid/model/isa.hpp"
#include "trochoid/model/stepping.hpp"
#include "trochoid/model/widely.hpp"

/// Explicit Runge-Kutta integration of order 8(5,3) with dense output of order 7 (DOP853,
/// [HairerNorsettWanner1993] II.5 and II.6), templated on the system and its scalar. No allocation.
///
/// A system is a struct of parameters with
///
///     template <class S> struct Pendulum {
///       using Scalar = S;                       // double or Dual<N>
///       static constexpr int kStates = 2;
///       S rate2_1_s2;
///       void derivative(double t_s, const State<S, 2>& y, State<S, 2>& dy) const {
///         dy[0] = y[1];
///         dy[1] = -rate2_1_s2 * sin(y[0]);
///       }
///     };
///
/// and, if it has events,
///
///       static constexpr int kEvents = 1;
///       void events(double t_s, const State<S, 2>& y, State<S, 1>& g) const { g[0] = y[0]; }
///       Pendulum<double> values() const;        // only for Dual: the same without derivatives
///
/// An event is a sign change of g, located on the dense output (integrate() in events.hpp).
namespace trochoid::model {
inline namespace TROCHOID_ISA {

/// N numbers; an array that shares no function with other instruction sets.
template <class S, int N>
struct State {
  S v[N];
  TROCHOID_INLINE S& operator[](int i) { return v[i]; }
  TROCHOID_INLINE const S& operator[](int i) const { return v[i]; }
};

template <class System>
class DormandPrince : public Stepping<DormandPrince<System>, System::kStates> {
 public:
  using S = typename System::Scalar;
  static constexpr int kN = System::kStates;
  using Y = State<S, kN>;
  static constexpr unsigned kAll = (kN >= 32) ? ~0u : (1u << kN) - 1u;
  static constexpr int kWork = 1;  ///< of a step, to compare steppers by

  DormandPrince(const System& system, const StepControl<kN>& control)
      : Steps(control), system_(system) {}

  /// Starts, or starts again after an event, at (t_s, y). Statistics go on.
  void start(double t_s, const Y& y) {
    this->stand_at(t_s);
    y_ = y_previous_ = y;
    dense_ready_ = 0;
    evaluate(t_, y_, k_[0]);
  }

  [[nodiscard]] const Y& y() const { return y_; }
  /// dy/dt at t_s() (the next step's first stage).
  [[nodiscard]] const Y& derivative() const { return k_[0]; }
  [[nodiscard]] const System& system() const { return system_; }
  /// Parameters may change at an event, before start().
  [[nodiscard]] System& system() { return system_; }

  /// Makes the last step's polynomials of the components in the bit mask; three more evaluations
  /// the first time. Before any step the polynomials are the constant start.
  void prepare_dense(unsigned components = kAll) {
    components &= kAll;
    if ((dense_ready_ & components) == components) return;
    if (step_ <= 0.0) {
      for (int c = 0; c < kN; ++c) {
        for (int r = 0; r < 7; ++r) r_[r][c] = S(0.0);
      }
      dense_ready_ = kAll;
      return;
    }
    if (dense_ready_ == 0) {
      extra_stage<13>();
      extra_stage<14>();
      extra_stage<15>();
    }
    for (int c = 0; c < kN; ++c) {
      if (((components & ~dense_ready_) >> c & 1u) != 0)
        widely<S>([&]() TROCHOID_LAMBDA_INLINE { coefficients(c); });
    }
    dense_ready_ |= components;
  }

  /// Component at fraction u in [0, 1] of the last step; prepare_dense() comes first.
  [[nodiscard]] TROCHOID_INLINE S dense(int component, double u) const {
    const double w = 1.0 - u;
    const int c = component;
    S y = r_[6][c] * u;
    y = (y + r_[5][c]) * w;
    y = (y + r_[4][c]) * u;
    y = (y + r_[3][c]) * w;
    y = (y + r_[2][c]) * u;
    y = (y + r_[1][c]) * w;
    y = (y + r_[0][c]) * u;
    return y + y_previous_[c];
  }
  /// The same without derivatives.
  [[nodiscard]] TROCHOID_INLINE double dense_value(int component, double u) const {
    const double w = 1.0 - u;
    const int c = component;
    double y = value_of(r_[6][c]) * u;
    y = (y + value_of(r_[5][c])) * w;
    y = (y + value_of(r_[4][c])) * u;
    y = (y + value_of(r_[3][c])) * w;
    y = (y + value_of(r_[2][c])) * u;
    y = (y + value_of(r_[1][c])) * w;
    y = (y + value_of(r_[0][c])) * u;
    return y + value_of(y_previous_[c]);
  }
  [[nodiscard]] Y dense_state(double u) const {
    Y y;
    for (int c = 0; c < kN; ++c) y[c] = dense(c, u);
    return y;
  }

 private:
  using Steps = Stepping<DormandPrince, System::kStates>;
  friend Steps;
  using Steps::control_, Steps::counts_, Steps::step_, Steps::t_, Steps::t_previous_;
  static constexpr bool kDerives = requires { S::kLanes; };

  TROCHOID_INLINE void evaluate(double t_s, const Y& y, Y& dy) {
    system_.derivative(t_s, y, dy);
    ++counts_.evaluations;
  }

  template <int Row, int J = 0>
  TROCHOID_INLINE void add_stages(S& sum, int c) const {
    if constexpr (J < Row) {
      if constexpr (dop853::kA[Row][J] != 0.0) sum += dop853::kA[Row][J] * k_[J][c];
      add_stages<Row, J + 1>(sum, c);
    }
  }
  template <int Row>
  TROCHOID_INLINE void stage_state(double h, Y& y) const {
    for (int c = 0; c < kN; ++c) {
      S sum = dop853::kA[Row][0] * k_[0][c];
      add_stages<Row, 1>(sum, c);
      y[c] = y_[c] + sum * h;
    }
  }
  template <int Row>
  TROCHOID_INLINE void run_stages(double h) {
    if constexpr (Row < dop853::kStages) {
      Y y;
      widely<S>([&]() TROCHOID_LAMBDA_INLINE { stage_state<Row>(h, y); });
      evaluate(t_ + dop853::kC[Row] * h, y, k_[Row]);
      if constexpr (kDerives && Row == dop853::kStages - 1) y_last_ = y;
      run_stages<Row + 1>(h);
    }
  }
  void get_ready() {}
  /// Stages, new state in y_next_ and the scaled error of a step h.
  [[nodiscard]] Attempt attempt(double h) {
    run_stages<1>(h);
    widely<S>([&]() TROCHOID_LAMBDA_INLINE { stage_state<dop853::kStages>(h, y_next_); });
    double error = error_norm(h);
    if constexpr (kDerives) {
      if (error <= 1.0) {
        evaluate(t_ + h, y_next_, k_[dop853::kStages]);
        const double growth = instability(h);
        error = growth > error ? growth : error;
      }
    }
    return {__builtin_isfinite(error) ? Attempt::End::done : Attempt::End::not_finite, error};
  }

  /// Where a strong loss holds the body, values stay at rest however long a step is, but
  /// derivatives run away beyond the method's limit of stability. The last stage and the new state
  /// are of one instant: how far apart their rates are over how far apart they are themselves is
  /// the fastest rate ([HairerWanner1996] IV.2), here of derivatives that have begun to run.
  /// @returns that times the step over the limit, to the power for which step_factor() keeps to it.
  [[nodiscard]] double instability(double h) const {
    constexpr double kStable = 6.1, kBegun = 1e-5;  // of the derivatives
    double fastest2 = 0.0;
    widely<S>([&]() TROCHOID_LAMBDA_INLINE {
      typename S::Lanes rates{}, states{}, whole{};
      for (int c = 0; c < kN; ++c) {
        const double size = scale(c, value_of(y_[c]), value_of(y_next_[c]));
        const double weight = 1.0 / (size * size);
        const auto& after = y_next_[c].derivative;
        const auto rate = k_[dop853::kStages][c].derivative - k_[dop853::kStages - 1][c].derivative;
        const auto state = after - y_last_[c].derivative;
        rates += rate * rate * weight;
        states += state * state * weight;
        whole += after * after * weight;
      }
      for (int lane = 0; lane < S::kLanes; ++lane)
        if (states[lane] > kBegun * kBegun * whole[lane] && rates[lane] > fastest2 * states[lane])
          fastest2 = rates[lane] / states[lane];
    });
    const double share2 = h * h * fastest2 * (1.0 / (kStable * kStable));
    return share2 * share2 * share2 * share2;
  }

  template <int J = 0>
  static TROCHOID_INLINE void add_errors(const double* k, double& third, double& fifth) {
    if constexpr (J < dop853::kStages) {
      if constexpr (dop853::kErrorThird[J] != 0.0) third += dop853::kErrorThird[J] * k[J];
      if constexpr (dop853::kErrorFifth[J] != 0.0) fifth += dop853::kErrorFifth[J] * k[J];
      add_errors<J + 1>(k, third, fifth);
    }
  }
  /// Hairer's combination of both estimates. The norm is the mean over components: the largest
  /// alone would let one that starts at zero set the step.
  [[nodiscard]] double error_norm(double h) const {
    double third = 0.0, fifth = 0.0;
    for (int c = 0; c < kN; ++c) {
      const double before = value_of(y_[c]), after = value_of(y_next_[c]);
      add_component(
          c, [](const S& x) TROCHOID_LAMBDA_INLINE { return value_of(x); }, scale(c, before, after),
          third, fifth);
    }
    double error = combine(h, third, fifth);
    if constexpr (requires { S::kLanes; }) {
      if (control_.control_derivatives) {
        for (int lane = 0; lane < S::kLanes; ++lane) {
          const double lane_error = lane_error_norm(h, lane);
          error = lane_error > error ? lane_error : error;
        }
      }
    }
    return error;
  }
  /// In strongly attracting flows rounding alone leaves that much in the derivatives: asking for
  /// less would only shorten the steps.
  static constexpr double kFinestOfDerivatives = 1e-11;
  [[nodiscard]] double lane_error_norm(double h, int lane) const {
    const double rtol = control_.rtol > kFinestOfDerivatives ? control_.rtol : kFinestOfDerivatives;
    double third = 0.0, fifth = 0.0, largest = 0.0;
    for (int c = 0; c < kN; ++c) {
      const double size = __builtin_fabs(y_next_[c].derivative[lane]);
      largest = size > largest ? size : largest;
    }
    if (largest == 0.0) return 0.0;
    for (int c = 0; c < kN; ++c) {
      add_component(
          c, [lane](const S& x) TROCHOID_LAMBDA_INLINE { return x.derivative[lane]; },
          rtol * largest, third, fifth);
    }
    return combine(h, third, fifth);
  }
  template <class Part>
  TROCHOID_INLINE void add_component(int c, Part part, double scale, double& third,
                                     double& fifth) const {
    double k[dop853::kStages];
    for (int j = 0; j < dop853::kStages; ++j) k[j] = part(k_[j][c]);
    double e3 = 0.0, e5 = 0.0;
    add_errors(k, e3, e5);
    e3 /= scale;
    e5 /= scale;
    third += e3 * e3;
    fifth += e5 * e5;
  }
  [[nodiscard]] TROCHOID_INLINE double scale(int c, double before, double after) const {
    const double a = __builtin_fabs(before), b = __builtin_fabs(after);
    const double scale = control_.atol[c] + control_.rtol * (a > b ? a : b);
    return scale > 0.0 ? scale : 1e-300;
  }
  [[nodiscard]] static TROCHOID_INLINE double combine(double h, double third, double fifth) {
    const double denominator = fifth + 0.01 * third;
    if (denominator == 0.0) return 0.0;
    return h * fifth / __builtin_sqrt(denominator * kN);
  }
  [[nodiscard]] static double step_factor(double error) {
    if (error <= 0.0) return 6.0;
    const double factor = 0.9 * __builtin_pow(error, -0.125);
    return factor < 0.333 ? 0.333 : (factor > 6.0 ? 6.0 : factor);
  }

  void accept(double /*h*/, double t_new) {
    if constexpr (!kDerives) evaluate(t_new, y_next_, k_[dop853::kStages]);
    y_previous_ = y_;
    first_stage_ = k_[0];
    y_ = y_next_;
    dense_ready_ = 0;
    k_[0] = k_[dop853::kStages];
  }

  /// Stage of the dense output. k_[0] already belongs to the next step, so its weight is applied to
  /// the kept copy.
  template <int Row>
  void extra_stage() {
    Y y;
    widely<S>([&]() TROCHOID_LAMBDA_INLINE {
      for (int c = 0; c < kN; ++c) {
        S sum = dop853::kA[Row][0] * first_stage_[c];
        add_stages<Row, 1>(sum, c);
        y[c] = y_previous_[c] + sum * step_;
      }
    });
    evaluate(t_previous_ + dop853::kC[Row] * step_, y, k_[Row]);
  }
  template <int Degree, int J = 1>
  TROCHOID_INLINE void add_dense(S& sum, int c) const {
    if constexpr (J < dop853::kAllStages) {
      if constexpr (dop853::kDense[Degree][J] != 0.0) sum += dop853::kDense[Degree][J] * k_[J][c];
      add_dense<Degree, J + 1>(sum, c);
    }
  }
  template <int Degree>
  TROCHOID_INLINE void dense_row(int c) {
    S sum = dop853::kDense[Degree][0] * first_stage_[c];
    add_dense<Degree>(sum, c);
    r_[3 + Degree][c] = sum * step_;
  }
  TROCHOID_INLINE void coefficients(int c) {
    const S rise = y_[c] - y_previous_[c];
    const S begin = first_stage_[c] * step_, end = k_[dop853::kStages][c] * step_;
    r_[0][c] = rise;
    r_[1][c] = begin - rise;
    r_[2][c] = rise * 2.0 - (begin + end);
    dense_row<0>(c);
    dense_row<1>(c);
    dense_row<2>(c);
    dense_row<3>(c);
  }

  /// [HairerNorsettWanner1993] II.4: a step whose Euler error and second derivative are small.
  [[nodiscard]] double first_step(double t_limit_s) {
    double size = 0.0, slope = 0.0;
    for (int c = 0; c < kN; ++c) {
      const double s = scale(c, value_of(y_[c]), 0.0);
      const double y = value_of(y_[c]) / s, dy = value_of(k_[0][c]) / s;
      size += y * y;
      slope += dy * dy;
    }
    double h = (size <= 1e-10 || slope <= 1e-10) ? 1e-6 : 0.01 * __builtin_sqrt(size / slope);
    const double span = t_limit_s - t_;
    h = h > span ? span : h;
    Y y;
    for (int c = 0; c < kN; ++c) y[c] = y_[c] + k_[0][c] * h;
    evaluate(t_ + h, y, k_[1]);
    double curvature = 0.0;
    for (int c = 0; c < kN; ++c) {
      const double s = scale(c, value_of(y_[c]), 0.0);
      const double change = (value_of(k_[1][c]) - value_of(k_[0][c])) / s;
      curvature += change * change;
    }
    curvature = __builtin_sqrt(curvature) / h;
    slope = __builtin_sqrt(slope);
    const double steepest = curvature > slope ? curvature : slope;
    const double second = steepest <= 1e-15 ? (1e-6 > h * 1e-3 ? 1e-6 : h * 1e-3)
                                            : __builtin_pow(0.01 / steepest, 0.125);
    h = 100.0 * h < second ? 100.0 * h : second;
    if (!__builtin_isfinite(h)) h = 1e-6;
    return h > span ? span : h;
  }

  System system_;
  unsigned dense_ready_ = 0;
  Y y_, y_previous_, y_next_, first_stage_;
  Y y_last_;  ///< at the last stage
  Y k_[dop853::kAllStages];
  Y r_[7];
};

}  // namespace TROCHOID_ISA
}  // namespace trochoid::model
