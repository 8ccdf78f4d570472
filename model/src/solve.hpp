#pragma once
#include <Eigen/Core>
#include <string>
#include <vector>

#include "factories.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/model/events.hpp"
#include "trochoid/model/simulate.hpp"
#include "trochoid/model/sundials.hpp"
#include "trochoid/model/taylor.hpp"

/// Smooth runs on a time grid by any of the integrators, for simulate().
namespace trochoid::model {

/// States at the times reached (one row each), and how it went.
struct Solution {
  Eigen::MatrixXd states;
  Outcome outcome = Outcome::reached_end;
  double end_s = 0.0;
  Statistics statistics;
};

enum class Method { taylor, dop853, radau, cvode_adams, cvode_bdf, arkode };

/// What a scene's run.integrator means for a model, with the reason in words.
struct Choice {
  Method method = Method::taylor;
  std::string name, reason;
};
/// Of a smooth polynomial model.
/// @throws InputError for an unknown name.
[[nodiscard]] Choice choose_integrator(const std::string& asked);

/// @returns the outputs with so many times between each two that what turns at `rate_rad_s` turns
/// by `largest_turn_rad` at most from one to the next, and can be followed; `parts` per interval.
/// @throws InputError if these are too many.
[[nodiscard]] std::vector<double> times_between(const std::vector<double>& t_s, double rate_rad_s,
                                                double largest_turn_rad, int& parts);

[[nodiscard]] Solution from_sundials(SundialsRun run);
[[nodiscard]] SundialsOptions sundials_options(Method method, double rtol, const double* atol,
                                               int states);

template <template <class> class Stepper, class System>
[[nodiscard]] Solution solve_stepwise(const System& system,
                                      const State<double, System::kStates>& start,
                                      const std::vector<double>& t_s,
                                      const StepControl<System::kStates>& control) {
  constexpr int n = System::kStates;
  Solution solution;
  solution.states.resize(static_cast<Eigen::Index>(t_s.size()), n);
  Stepper<System> stepper(system, control);
  stepper.start(t_s.front(), start);
  int reached = 0;
  const auto run = integrate(stepper, t_s.back(), t_s.data(), static_cast<int>(t_s.size()),
                             [&](const auto& step, int first, int last) {
                               for (int row = first; row < last; ++row) {
                                 const double u = step.fraction(t_s[static_cast<std::size_t>(row)]);
                                 for (int c = 0; c < n; ++c)
                                   solution.states(row, c) = step.dense(c, u);
                               }
                               reached = last;
                             });
  solution.states.conservativeResize(reached, n);
  solution.outcome = outcome_of(run.end);
  solution.end_s = run.t_s;
  const StepCounts& counts = stepper.counts();
  solution.statistics = {counts.steps, counts.rejected, counts.evaluations};
  return solution;
}

/// @param duals  the same system over Dual, for the exact Jacobian of the implicit methods.
template <class System, class DualSystem>
[[nodiscard]] Solution solve(const System& system, const DualSystem& duals,
                             const State<double, System::kStates>& start,
                             const std::vector<double>& t_s,
                             const StepControl<System::kStates>& control, Method method) {
  if (method == Method::taylor) return solve_stepwise<Taylor>(system, start, t_s, control);
  if (method == Method::dop853) return solve_stepwise<DormandPrince>(system, start, t_s, control);
  constexpr int n = System::kStates;
  const Eigen::VectorXd y0 = Eigen::Map<const Eigen::VectorXd>(start.v, n);
  return from_sundials(integrate_sundials(make_ode(duals), t_s.front(), y0, t_s,
                                          sundials_options(method, control.rtol, control.atol, n)));
}

}  // namespace trochoid::model
