#pragma once
#include "trochoid/model/isa.hpp"

/// How long the steps of an integration are: what explicit and implicit steppers share.
namespace trochoid::model {
inline namespace TROCHOID_ISA {

/// What a step may cost. The error of component i is measured in rtol |y_i| + atol_i. Leave atol_i
/// at the size where the component stops to matter, times rtol: a fast spin has its own scale and
/// must not set that of a slow angle.
template <int N>
struct StepControl {
  double rtol = 1e-10;
  double atol[N] = {};
  double first_step_s = 0.0;  ///< 0: chosen from the derivatives
  double max_step_s = 0.0;    ///< 0: unlimited
  int max_steps = 1000000;
  /// Dual only: lanes must meet the tolerance as well, down to 1e-11.
  bool control_derivatives = false;
};

/// The same tolerance for every component, relative and absolute.
template <int N>
[[nodiscard]] TROCHOID_INLINE StepControl<N> uniform_control(double tolerance) {
  StepControl<N> control;
  control.rtol = tolerance;
  for (int i = 0; i < N; ++i) control.atol[i] = tolerance;
  return control;
}

enum class StepEnd { accepted, step_limit, rounding_limit, not_finite };

struct StepCounts {
  int steps = 0;
  int rejected = 0;
  int evaluations = 0;
};

/// What came of trying a step.
struct Attempt {
  enum class End { done, diverged, not_finite } end = End::done;
  double error = 0.0;  ///< of a step that is done, in units of the tolerance
};

/// Where a stepper with N states is, and how it gets on. Stepper itself has first_step(t_limit_s);
/// get_ready(), before the first attempt from where it is; attempt(h); step_factor(error), a next
/// step over one of this error; accept(h, t_new), of the step tried last.
template <class Stepper, int N>
class Stepping {
 public:
  /// One accepted step forward, never beyond t_limit_s.
  [[nodiscard]] StepEnd step(double t_limit_s) {
    if (h_ <= 0.0) h_ = self().first_step(t_limit_s);
    self().get_ready();
    int attempts_not_finite = 0;
    while (true) {
      if (counts_.steps + counts_.rejected >= control_.max_steps) return StepEnd::step_limit;
      double h = h_;
      if (control_.max_step_s > 0.0 && h > control_.max_step_s) h = control_.max_step_s;
      const bool last = t_ + 1.01 * h >= t_limit_s;
      if (last) h = t_limit_s - t_;
      if (!(h > 0.0) || (!last && h <= 1e-15 * __builtin_fabs(t_)))
        return attempts_not_finite > 0 ? StepEnd::not_finite : StepEnd::rounding_limit;
      const Attempt tried = self().attempt(h);
      const double factor = factor_after(tried);
      if (tried.end == Attempt::End::done && tried.error <= 1.0) {
        const double t_new = last ? t_limit_s : t_ + h;
        self().accept(h, t_new);
        count(h, t_new);
        // A step cut short by the limit says little about the next one: keep the longer of the two.
        const double next = h * (rejected_before_ && factor > 1.0 ? 1.0 : factor);
        h_ = last && next < h_ ? h_ : next;
        rejected_before_ = false;
        return StepEnd::accepted;
      }
      ++counts_.rejected;
      rejected_before_ = true;
      if (tried.end == Attempt::End::not_finite && ++attempts_not_finite > 40)
        return StepEnd::not_finite;
      h_ = h * factor;
    }
  }

  [[nodiscard]] double t_s() const { return t_; }
  [[nodiscard]] double t_previous_s() const { return t_previous_; }
  [[nodiscard]] double step_s() const { return step_; }
  /// How far into the last step, 0 to 1.
  [[nodiscard]] double fraction(double t_s) const {
    return step_ > 0.0 ? (t_s - t_previous_) / step_ : 0.0;
  }
  [[nodiscard]] const StepCounts& counts() const { return counts_; }

 protected:
  explicit Stepping(const StepControl<N>& control) : control_(control) {}

  /// Starts, or starts again.
  void stand_at(double t_s) {
    t_ = t_previous_ = t_s;
    step_ = 0.0;
    rejected_before_ = false;
    h_ = control_.first_step_s > 0.0 ? control_.first_step_s : 0.0;
  }

  StepControl<N> control_;
  StepCounts counts_;
  double t_ = 0.0, t_previous_ = 0.0, step_ = 0.0;

 private:
  [[nodiscard]] Stepper& self() { return static_cast<Stepper&>(*this); }
  [[nodiscard]] double factor_after(const Attempt& tried) const {
    if (tried.end == Attempt::End::done) return Stepper::step_factor(tried.error);
    return tried.end == Attempt::End::diverged ? 0.4 : 0.1;
  }
  void count(double h, double t_new) {
    t_previous_ = t_;
    t_ = t_new;
    step_ = h;
    ++counts_.steps;
  }

  double h_ = 0.0;  ///< of the next step
  bool rejected_before_ = false;
};

}  // namespace TROCHOID_ISA
}  // namespace trochoid::model
