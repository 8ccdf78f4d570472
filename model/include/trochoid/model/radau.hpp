#pragma once
#include "trochoid/model/dormand_prince.hpp"

/// Implicit Runge-Kutta integration for stiff equations: Radau IIA of order 5 with dense output of
/// order 4, [HairerWanner1996] IV.8, for the systems and with the interface of DormandPrince.
/// Derivatives go through Newton's iteration like any other number: its matrix has none, so that
/// they converge as the values do. No allocation.
namespace trochoid::model {
inline namespace TROCHOID_ISA {

/// Real and imaginary part.
struct Complex {
  double re, im;
};

/// An LU decomposition with row pivots of a small real or complex matrix, for right sides of any
/// scalar.
template <class Number, int N>
class SmallLu {
 public:
  /// @returns false if the matrix is singular or not finite.
  [[nodiscard]] bool factorise(const Number (&matrix)[N][N]) {
    for (int i = 0; i < N; ++i)
      for (int j = 0; j < N; ++j) lu_[i][j] = matrix[i][j];
    for (int k = 0; k < N; ++k) {
      pivot_[k] = k;
      for (int i = k + 1; i < N; ++i)
        if (size(lu_[i][k]) > size(lu_[pivot_[k]][k])) pivot_[k] = i;
      const double pivot = size(lu_[pivot_[k]][k]);
      if (!(pivot > 0.0 && __builtin_isfinite(pivot))) return false;
      for (int j = 0; j < N && pivot_[k] != k; ++j) swap(lu_[k][j], lu_[pivot_[k]][j]);
      inverse_[k] = reciprocal(lu_[k][k]);
      for (int i = k + 1; i < N; ++i) {
        lu_[i][k] = product(lu_[i][k], inverse_[k]);
        for (int j = k + 1; j < N; ++j) subtract(lu_[i][j], lu_[i][k], lu_[k][j]);
      }
    }
    return true;
  }
  /// x: the right side, then the solution. A complex one is a pair of real states.
  template <class Vector>
  TROCHOID_INLINE void solve(Vector& x) const {
    for (int k = 0; k < N; ++k) x.exchange(k, pivot_[k]);
    for (int i = 1; i < N; ++i)
      for (int j = 0; j < i; ++j) x.subtract(i, lu_[i][j], j);
    for (int i = N - 1; i >= 0; --i) {
      for (int j = i + 1; j < N; ++j) x.subtract(i, lu_[i][j], j);
      x.multiply(i, inverse_[i]);
    }
  }

 private:
  static double size(double a) { return __builtin_fabs(a); }
  static double size(Complex a) { return a.re * a.re + a.im * a.im; }
  static double reciprocal(double a) { return 1.0 / a; }
  static Complex reciprocal(Complex a) {
    const double scale = 1.0 / size(a);
    return {a.re * scale, -a.im * scale};
  }
  static double product(double a, double b) { return a * b; }
  static Complex product(Complex a, Complex b) {
    return {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
  }
  static void subtract(double& from, double a, double b) { from -= a * b; }
  static void subtract(Complex& from, Complex a, Complex b) {
    const Complex p = product(a, b);
    from.re -= p.re;
    from.im -= p.im;
  }
  static void swap(Number& a, Number& b) {
    const Number kept = a;
    a = b;
    b = kept;
  }

  Number lu_[N][N];
  Number inverse_[N];
  int pivot_[N];
};

/// Right sides for SmallLu.
template <class S, int N>
struct RealSide {
  State<S, N>& x;
  TROCHOID_INLINE void exchange(int i, int j) {
    const S kept = x[i];
    x[i] = x[j];
    x[j] = kept;
  }
  TROCHOID_INLINE void subtract(int i, double a, int j) { x[i] -= x[j] * a; }
  TROCHOID_INLINE void multiply(int i, double a) { x[i] *= a; }
};
template <class S, int N>
struct ComplexSide {
  State<S, N>&re, &im;
  TROCHOID_INLINE void exchange(int i, int j) {
    RealSide<S, N>{re}.exchange(i, j);
    RealSide<S, N>{im}.exchange(i, j);
  }
  TROCHOID_INLINE void subtract(int i, Complex a, int j) {
    re[i] -= re[j] * a.re - im[j] * a.im;
    im[i] -= re[j] * a.im + im[j] * a.re;
  }
  TROCHOID_INLINE void multiply(int i, Complex a) {
    const S kept = re[i];
    re[i] = kept * a.re - im[i] * a.im;
    im[i] = kept * a.im + im[i] * a.re;
  }
};

/// Coefficients of the method, [HairerWanner1996] table IV.5.6, and of the transformation that
/// makes the inverse of its matrix block diagonal (IV.8.4).
namespace radau {
inline constexpr double kRoot6 = 2.449489742783178098197284074705891;
inline constexpr double kC1 = (4.0 - kRoot6) / 10.0, kC2 = (4.0 + kRoot6) / 10.0;
/// Eigenvalues of the inverse of the method's matrix: one real, two complex.
inline constexpr double kReal = 3.637834252744495732208418513577775;
inline constexpr double kRe = 2.681082873627752133895790743211113;
inline constexpr double kIm = 3.050430199247410569426377624787569;
inline constexpr double kT[3][3] = {
    {9.1232394870892942792e-02, -0.14125529502095420843, -3.0029194105147424492e-02},
    {0.24171793270710701896, 0.20412935229379993199, 0.38294211275726193779},
    {0.96604818261509293619, 1.0, 0.0}};
inline constexpr double kInverseT[3][3] = {
    {4.3255798900631553510, 0.33919925181580986954, 0.54177053993587487119},
    {-4.1787185915519047273, -0.32768282076106238708, 0.47662355450055045196},
    {-0.50287263494578687595, 2.5719269498556054292, -0.59603920482822492497}};
/// Of the error estimate.
inline constexpr double kError[3] = {-(13.0 + 7.0 * kRoot6) / 3.0, (-13.0 + 7.0 * kRoot6) / 3.0,
                                     -1.0 / 3.0};
}  // namespace radau

template <class System>
class Radau : public Stepping<Radau<System>, System::kStates> {
 public:
  using S = typename System::Scalar;
  static constexpr int kN = System::kStates;
  using Y = State<S, kN>;
  static constexpr unsigned kAll = (kN >= 32) ? ~0u : (1u << kN) - 1u;
  static constexpr int kWork = 3;  ///< of a step, in those of DormandPrince

  /// The local error is estimated at third order, far above that of the step taken: held to a lower
  /// power of the tolerance, as in [HairerWanner1996]'s own program, it leaves an error of the size
  /// asked for.
  [[nodiscard]] static StepControl<kN> loosened(StepControl<kN> control) {
    const double looser = 0.03 * __builtin_pow(control.rtol, 2.0 / 3.0) / control.rtol;
    control.rtol *= looser;
    for (double& atol : control.atol) atol *= looser;
    return control;
  }

  /// @param control  loosened(), in general; every absolute tolerance above 0: they tell the
  ///                 components' sizes.
  Radau(const System& system, const StepControl<kN>& control)
      : Steps(control), system_(system), plain_(plain(system)) {
    for (int i = 0; i < kN; ++i) size_[i] = control.atol[i] / control.rtol;
    const double root = __builtin_sqrt(control.rtol);
    converged_ = root < 0.03 ? root : 0.03;
  }

  /// Starts, or starts again after an event, at (t_s, y). Statistics go on.
  void start(double t_s, const Y& y) {
    this->stand_at(t_s);
    y_ = y;
    for (int c = 0; c < kN; ++c) {
      for (Y& row : dense_) row[c] = S(0.0);
      bend_[c] = S(0.0);
    }
    evaluate(t_, y_, slope_);
  }

  [[nodiscard]] const Y& y() const { return y_; }
  [[nodiscard]] const Y& derivative() const { return slope_; }
  [[nodiscard]] const System& system() const { return system_; }

  /// The last step's polynomials are always ready.
  void prepare_dense(unsigned = kAll) {}
  /// Component at fraction u in [0, 1] of the last step.
  [[nodiscard]] TROCHOID_INLINE S dense(int c, double u) const {
    return y_[c] + increment(dense_[0][c], dense_[1][c], dense_[2][c], u - 1.0) +
           bend_[c] * bending(u);
  }
  [[nodiscard]] TROCHOID_INLINE double dense_value(int c, double u) const {
    return value_of(y_[c]) +
           increment(value_of(dense_[0][c]), value_of(dense_[1][c]), value_of(dense_[2][c]),
                     u - 1.0) +
           value_of(bend_[c]) * bending(u);
  }
  [[nodiscard]] Y dense_state(double u) const {
    Y y;
    for (int c = 0; c < kN; ++c) y[c] = dense(c, u);
    return y;
  }

 private:
  using Steps = Stepping<Radau, System::kStates>;
  friend Steps;
  using Steps::control_, Steps::counts_, Steps::step_, Steps::t_;

  static auto plain(const System& system) {
    if constexpr (requires { S::kLanes; })
      return system.values();
    else
      return system;
  }
  using Plain = decltype(plain(*static_cast<const System*>(nullptr)));

  TROCHOID_INLINE void evaluate(double t_s, const Y& y, Y& dy) {
    system_.derivative(t_s, y, dy);
    ++counts_.evaluations;
  }

  /// Newton's form through the ends of the step and the stages, from the end on.
  template <class T>
  [[nodiscard]] static TROCHOID_INLINE T increment(const T& a, const T& b, const T& c, double s) {
    return (a + (b + c * (s - (radau::kC1 - 1.0))) * (s - (radau::kC2 - 1.0))) * s;
  }

  /// What gives the collocation polynomial, whose slopes are right at the stages, another one at
  /// the start and leaves the rest: of slope 1 there, level at the stages and zero at both ends, as
  /// the nodes are Radau's. It makes the dense output one order better.
  [[nodiscard]] static TROCHOID_INLINE double bending(double u) {
    return u * (1.0 + u * (-4.5 + u * (6.0 - 2.5 * u)));
  }

  /// The Jacobian, by difference quotients: Newton's iteration needs no better.
  void get_ready() {
    State<double, kN> y, rate, moved;
    for (int i = 0; i < kN; ++i) y[i] = value_of(y_[i]);
    plain_.derivative(t_, y, rate);
    for (int j = 0; j < kN; ++j) {
      const double kept = y[j];
      const double scale = __builtin_fabs(kept) > size_[j] ? __builtin_fabs(kept) : size_[j];
      y[j] = kept + 1e-8 * scale;
      const double inverse = 1.0 / (y[j] - kept);
      plain_.derivative(t_, y, moved);
      for (int i = 0; i < kN; ++i) jacobian_[i][j] = (moved[i] - rate[i]) * inverse;
      y[j] = kept;
    }
    counts_.evaluations += kN + 1;
  }

  /// The matrices of Newton's iteration; false if one is singular or not finite.
  [[nodiscard]] bool prepare(double h) {
    double real[kN][kN];
    Complex complex[kN][kN];
    for (int i = 0; i < kN; ++i)
      for (int j = 0; j < kN; ++j) {
        const double one = i == j ? 1.0 / h : 0.0;
        real[i][j] = radau::kReal * one - jacobian_[i][j];
        complex[i][j] = {radau::kRe * one - jacobian_[i][j], radau::kIm * one};
      }
    return real_.factorise(real) && complex_.factorise(complex);
  }

  /// The last step's polynomial, carried on, starts the iteration.
  void guess(double h) {
    const double ratio = step_ > 0.0 ? h / step_ : 0.0;
    const double at[3] = {radau::kC1 * ratio, radau::kC2 * ratio, ratio};
    for (int s = 0; s < 3; ++s)
      for (int c = 0; c < kN; ++c)
        z_[s][c] = increment(dense_[0][c], dense_[1][c], dense_[2][c], at[s]);
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < kN; ++c)
        w_[r][c] = z_[0][c] * radau::kInverseT[r][0] + z_[1][c] * radau::kInverseT[r][1] +
                   z_[2][c] * radau::kInverseT[r][2];
  }

  /// One step of Newton's iteration, from the slopes at the stages. Values that are `found` stay:
  /// they are the same with derivatives and without.
  TROCHOID_INLINE void improve(double h, bool found) {
    if constexpr (requires { S::kLanes; }) {
      improve_part<typename S::Lanes>(
          h, [](auto& number) TROCHOID_LAMBDA_INLINE -> auto& { return number.derivative; });
      const auto value = [](auto& number) TROCHOID_LAMBDA_INLINE -> auto& {
        return number.value;
      };
      if (!found) return improve_part<double>(h, value);
      for (Y& change : change_)
        for (S& of_component : change.v) of_component.value = 0.0;
    } else {
      improve_part<S>(
          h, [](auto& number) TROCHOID_LAMBDA_INLINE -> auto& { return number; });
    }
  }

  /// The iteration is linear in the slopes: values and derivatives go through it each on their own,
  /// derivatives in whole registers.
  template <class T, class Part>
  TROCHOID_INLINE void improve_part(double h, const Part& part) {
    const double real = radau::kReal / h, re = radau::kRe / h, im = radau::kIm / h;
    State<T, kN> change[3];
    for (int c = 0; c < kN; ++c) {
      T f[3];
      for (int r = 0; r < 3; ++r)
        f[r] = part(k_[0][c]) * radau::kInverseT[r][0] + part(k_[1][c]) * radau::kInverseT[r][1] +
               part(k_[2][c]) * radau::kInverseT[r][2];
      change[0][c] = f[0] - part(w_[0][c]) * real;
      change[1][c] = f[1] - part(w_[1][c]) * re + part(w_[2][c]) * im;
      change[2][c] = f[2] - part(w_[2][c]) * re - part(w_[1][c]) * im;
    }
    RealSide<T, kN> first{change[0]};
    ComplexSide<T, kN> second{change[1], change[2]};
    real_.solve(first);
    complex_.solve(second);
    for (int c = 0; c < kN; ++c) {
      for (int r = 0; r < 3; ++r) {
        part(change_[r][c]) = change[r][c];
        part(w_[r][c]) += change[r][c];
      }
      for (int s = 0; s < 3; ++s)
        part(z_[s][c]) = part(w_[0][c]) * radau::kT[s][0] + part(w_[1][c]) * radau::kT[s][1] +
                         part(w_[2][c]) * radau::kT[s][2];
    }
  }

  [[nodiscard]] double scale(int c) const {
    return control_.atol[c] + control_.rtol * __builtin_fabs(value_of(y_[c]));
  }

  [[nodiscard]] double change_norm() const {
    double sum = 0.0;
    for (int c = 0; c < kN; ++c)
      for (const Y& change : change_) {
        const double part = value_of(change[c]) / scale(c);
        sum += part * part;
      }
    return __builtin_sqrt(sum / (3 * kN));
  }

  /// Whether the last change of every derivative is small beside the derivative, each component
  /// measured by its size.
  [[nodiscard]] bool derivatives_rest() const {
    constexpr double kRest = 1e-4;  // what the next change would leave is far less
    if constexpr (requires { S::kLanes; }) {
      typename S::Lanes changed{}, all{};
      for (int c = 0; c < kN; ++c) {
        const double weight = 1.0 / (size_[c] * size_[c]);
        for (int s = 0; s < 3; ++s) {
          const auto whole = y_[c].derivative + z_[s][c].derivative;
          changed += change_[s][c].derivative * change_[s][c].derivative * weight;
          all += whole * whole * weight;
        }
      }
      for (int lane = 0; lane < S::kLanes; ++lane)
        if (!(changed[lane] <= kRest * kRest * all[lane])) return false;
    }
    return true;
  }

  [[nodiscard]] Attempt attempt(double h) {
    Attempt tried{prepare(h) ? find_stages(h) : Attempt::End::not_finite};
    if (tried.end == Attempt::End::done) tried.error = error_norm(h);
    if (!__builtin_isfinite(tried.error)) tried.end = Attempt::End::not_finite;
    return tried;
  }

  [[nodiscard]] bool derivatives_finite() const {
    if constexpr (requires { S::kLanes; })
      for (const S& after : z_[2].v)
        for (int lane = 0; lane < S::kLanes; ++lane)
          if (!__builtin_isfinite(after.derivative[lane])) return false;
    return true;
  }

  [[nodiscard]] Attempt::End find_stages(double h) {
    constexpr int kMost = 10;
    constexpr double kC[3] = {radau::kC1, radau::kC2, 1.0};
    guess(h);
    double before = 0.0;
    bool values_rest = false;
    for (int iteration = 0; iteration < kMost; ++iteration) {
      for (int s = 0; s < 3; ++s) {
        Y stage;
        for (int c = 0; c < kN; ++c) stage[c] = y_[c] + z_[s][c];
        evaluate(t_ + kC[s] * h, stage, k_[s]);
      }
      widely<S>([&]() TROCHOID_LAMBDA_INLINE { improve(h, values_rest); });
      const double change = change_norm();
      if (!__builtin_isfinite(change)) return Attempt::End::not_finite;
      if (!values_rest && iteration > 0) {
        const double rate = change / before;
        if (rate >= 0.99) return Attempt::End::diverged;
        values_rest = rate / (1.0 - rate) * change <= converged_;
      }
      values_rest = values_rest || change <= 1e-3 * converged_;
      if (values_rest && derivatives_rest()) return Attempt::End::done;
      before = change;
    }
    return derivatives_finite() ? Attempt::End::diverged : Attempt::End::not_finite;
  }

  /// Of the collocation polynomial at the start of the step.
  [[nodiscard]] TROCHOID_INLINE S missing_slope(double h, int c) const {
    S slope = slope_[c];
    for (int s = 0; s < 3; ++s) slope += z_[s][c] * (radau::kError[s] / h);
    return slope;
  }

  /// (IV.8.19). Without the second, laxer estimate at a stiff start: what the body does there is
  /// part of its path.
  [[nodiscard]] double error_norm(double h) const {
    State<double, kN> error;
    for (int c = 0; c < kN; ++c) error[c] = value_of(missing_slope(h, c));
    RealSide<double, kN> side{error};
    real_.solve(side);
    double sum = 0.0;
    for (int c = 0; c < kN; ++c) sum += error[c] / scale(c) * (error[c] / scale(c));
    return __builtin_sqrt(sum / kN);
  }

  [[nodiscard]] static double step_factor(double error) {
    const double factor = error > 0.0 ? 0.9 * __builtin_pow(error, -0.25) : 8.0;
    return factor < 0.2 ? 0.2 : (factor > 8.0 ? 8.0 : factor);
  }

  void accept(double h, double t_new) {
    for (int c = 0; c < kN; ++c) bend_[c] = missing_slope(h, c);
    RealSide<S, kN> side{bend_};
    real_.solve(side);
    for (int c = 0; c < kN; ++c) {
      bend_[c] *= radau::kReal;
      const S after = (z_[1][c] - z_[2][c]) * (1.0 / (radau::kC2 - 1.0));
      const S between = (z_[0][c] - z_[1][c]) * (1.0 / (radau::kC1 - radau::kC2));
      const S bend = (between - z_[0][c] * (1.0 / radau::kC1)) * (1.0 / radau::kC2);
      dense_[0][c] = after;
      dense_[1][c] = (between - after) * (1.0 / (radau::kC1 - 1.0));
      dense_[2][c] = dense_[1][c] - bend;
      y_[c] += z_[2][c];
    }
    evaluate(t_new, y_, slope_);
  }

  /// A change of every component by a hundredth of its tolerance's size; the error tells the rest.
  [[nodiscard]] double first_step(double t_limit_s) const {
    double fastest = 0.0;
    for (int c = 0; c < kN; ++c) {
      const double rate = value_of(slope_[c]) / (size_[c] + __builtin_fabs(value_of(y_[c])));
      if (__builtin_fabs(rate) > fastest) fastest = __builtin_fabs(rate);
    }
    const double span = t_limit_s - t_;
    const double h = 0.01 * __builtin_sqrt(control_.rtol) / (fastest + 1.0 / span);
    return h < span ? h : span;
  }

  System system_;
  Plain plain_;
  double size_[kN];
  double converged_ = 0.0;  ///< what Newton's iteration may leave, in tolerances
  double jacobian_[kN][kN];
  SmallLu<double, kN> real_;
  SmallLu<Complex, kN> complex_;
  Y y_, slope_;
  Y z_[3], w_[3], k_[3], change_[3], dense_[3], bend_;
};

}  // namespace TROCHOID_ISA
}  // namespace trochoid::model
