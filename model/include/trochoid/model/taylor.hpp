#pragma once
#include "trochoid/model/dormand_prince.hpp"

/// Taylor-series integration of polynomial (and rational) systems [JorbaZou2005]: the coefficients
/// of the solution follow from those of products, one order after the other; the step is then as
/// long as the last two coefficients allow. The series is its own dense output. It wins over
/// Runge-Kutta where a right-hand side is a handful of products and the tolerance is 1e-9 or
/// tighter.
///
/// A system adds to what DormandPrince wants
///
///     void series(const Series<S>* y, int n, State<S, kStates>& dy) const;
///
/// which writes coefficient n of dy/dt, given coefficients 0..n of every component.
namespace trochoid::model {
inline namespace TROCHOID_ISA {

inline constexpr int kTaylorOrder = 16;

/// Coefficients of one component in powers of the time since the step's start.
template <class S>
struct Series {
  S c[kTaylorOrder + 1];
  TROCHOID_INLINE S& operator[](int n) { return c[n]; }
  TROCHOID_INLINE const S& operator[](int n) const { return c[n]; }
};

TROCHOID_INLINE void multiply_add(double& sum, double a, double b) {
  sum += a * b;
}
template <int N>
TROCHOID_INLINE void multiply_add(Dual<N>& sum, const Dual<N>& a, const Dual<N>& b) {
  sum.value += a.value * b.value;
  sum.derivative += a.value * b.derivative;
  sum.derivative += b.value * a.derivative;
}

/// x / n for a small whole number.
template <class S>
TROCHOID_INLINE S divided(const S& x, int n) {
  return x * (1.0 / n);
}

/// Coefficient n of the product a b. Two sums: one chain of additions would wait for itself.
template <class S>
TROCHOID_INLINE S product(const Series<S>& a, const Series<S>& b, int n) {
  S even(0.0), odd(0.0);
  int j = 0;
  for (; j + 1 <= n; j += 2) {
    multiply_add(even, a[j], b[n - j]);
    multiply_add(odd, a[j + 1], b[n - j - 1]);
  }
  if (j <= n) multiply_add(even, a[j], b[n - j]);
  return even + odd;
}

/// Steps like DormandPrince, with the same interface.
template <class System>
class Taylor {
 public:
  using S = typename System::Scalar;
  static constexpr int kN = System::kStates;
  static constexpr int kOrder = kTaylorOrder;
  using Y = State<S, kN>;

  Taylor(const System& system, const StepControl<kN>& control)
      : system_(system), control_(control) {}

  void start(double t_s, const Y& y) {
    t_ = t_previous_ = t_s;
    y_ = y;
    step_ = 0.0;
    for (int c = 0; c < kN; ++c) {
      series_[c][0] = y[c];
      for (int n = 1; n <= kOrder; ++n) series_[c][n] = S(0.0);
    }
  }

  [[nodiscard]] StepEnd step(double t_limit_s) {
    if (counts_.steps >= control_.max_steps) return StepEnd::step_limit;
    expand();
    double h = longest_step();
    if (!(h > 0.0)) return StepEnd::not_finite;
    const bool last = t_ + h >= t_limit_s;
    if (last) h = t_limit_s - t_;
    if (!last && h <= 1e-15 * __builtin_fabs(t_)) return StepEnd::rounding_limit;
    t_previous_ = t_;
    t_ = last ? t_limit_s : t_ + h;
    step_ = t_ - t_previous_;
    for (int c = 0; c < kN; ++c) y_[c] = at(c, step_);
    for (int c = 0; c < kN; ++c) {
      if (!__builtin_isfinite(value_of(y_[c]))) return StepEnd::not_finite;
    }
    ++counts_.steps;
    counts_.evaluations += kOrder;
    return StepEnd::accepted;
  }

  [[nodiscard]] double t_s() const { return t_; }
  [[nodiscard]] double t_previous_s() const { return t_previous_; }
  [[nodiscard]] double step_s() const { return step_; }
  [[nodiscard]] const Y& y() const { return y_; }
  [[nodiscard]] const StepCounts& counts() const { return counts_; }
  [[nodiscard]] const System& system() const { return system_; }
  [[nodiscard]] System& system() { return system_; }
  [[nodiscard]] const Series<S>& series(int component) const { return series_[component]; }

  void prepare_dense(unsigned = ~0u) {}  ///< the series is there already
  [[nodiscard]] double fraction(double t_s) const {
    return step_ > 0.0 ? (t_s - t_previous_) / step_ : 0.0;
  }
  [[nodiscard]] TROCHOID_INLINE S dense(int component, double u) const {
    return at(component, u * step_);
  }
  [[nodiscard]] TROCHOID_INLINE double dense_value(int component, double u) const {
    const double s = u * step_;
    const Series<S>& c = series_[component];
    double y = value_of(c[kOrder]);
    for (int n = kOrder - 1; n >= 0; --n) y = y * s + value_of(c[n]);
    return y;
  }
  [[nodiscard]] Y dense_state(double u) const {
    Y y;
    for (int c = 0; c < kN; ++c) y[c] = dense(c, u);
    return y;
  }

 private:
  [[nodiscard]] TROCHOID_INLINE S at(int component, double s) const {
    const Series<S>& c = series_[component];
    S y = c[kOrder];
    for (int n = kOrder - 1; n >= 0; --n) y = y * s + c[n];
    return y;
  }
  void expand() {
    for (int c = 0; c < kN; ++c) series_[c][0] = y_[c];
    for (int n = 0; n < kOrder; ++n) {
      Y dy;
      system_.series(series_, n, dy);
      for (int c = 0; c < kN; ++c) series_[c][n + 1] = divided(dy[c], n + 1);
    }
  }
  /// Largest scaled coefficient of one order.
  [[nodiscard]] double size(int n) const {
    double largest = 0.0;
    for (int c = 0; c < kN; ++c) {
      const double scale = control_.atol[c] + control_.rtol * __builtin_fabs(value_of(y_[c]));
      const double size = __builtin_fabs(value_of(series_[c][n])) / (scale > 0.0 ? scale : 1e-300);
      largest = size > largest ? size : largest;
      if (!__builtin_isfinite(size)) return size;
    }
    return largest;
  }
  /// The last two terms each stay within the tolerance; two, since one may vanish by symmetry.
  /// @returns NaN if the series is not finite.
  [[nodiscard]] double longest_step() const {
    const double last = size(kOrder), before = size(kOrder - 1);
    if (!__builtin_isfinite(last) || !__builtin_isfinite(before)) return __builtin_nan("");
    constexpr double kSafety = 0.9;
    // A constant solution has no terms: any step will do.
    const double by_last = last > 0.0 ? __builtin_pow(last, -1.0 / kOrder) : 1e300;
    const double by_before = before > 0.0 ? __builtin_pow(before, -1.0 / (kOrder - 1)) : 1e300;
    return kSafety * (by_last < by_before ? by_last : by_before);
  }

  System system_;
  StepControl<kN> control_;
  StepCounts counts_;
  double t_ = 0.0, t_previous_ = 0.0, step_ = 0.0;
  Y y_;
  Series<S> series_[kN];
};

}  // namespace TROCHOID_ISA
}  // namespace trochoid::model
