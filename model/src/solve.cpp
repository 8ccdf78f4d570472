#include "solve.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace trochoid::model {

Choice choose_integrator(const std::string& asked) {
  if (asked == "auto") {
    return {
        Method::taylor, "taylor",
        "polynomial equations without events: a Taylor series of order 16 needs the fewest steps"};
  }
  if (asked == "taylor") return {Method::taylor, asked, "asked for"};
  if (asked == "dop853") return {Method::dop853, asked, "asked for"};
  if (asked == "cvode-adams") return {Method::cvode_adams, asked, "asked for"};
  if (asked == "cvode-bdf") return {Method::cvode_bdf, asked, "asked for"};
  if (asked == "arkode") return {Method::arkode, asked, "asked for"};
  if (asked == "radau")
    throw NotOffered(
        "run.integrator = \"radau\" is for friction that sets in softly (model.friction above 0, "
        "with model.slip_regularisation_m_s); other models take auto, taylor, dop853, cvode-adams, "
        "cvode-bdf or arkode");
  throw InputError(
      fmt::format("run.integrator = \"{}\" must be auto, taylor, dop853, cvode-adams, cvode-bdf, "
                  "arkode or, for friction that sets in softly, radau",
                  asked));
}

SundialsOptions sundials_options(Method method, double rtol, const double* atol, int states) {
  SundialsOptions options;
  options.method = method == Method::cvode_adams ? SundialsMethod::cvode_adams
                   : method == Method::cvode_bdf ? SundialsMethod::cvode_bdf
                                                 : SundialsMethod::arkode_erk;
  // Their multistep error control has no use for tolerances within rounding of the state.
  constexpr double kFinest = 1e-14;
  options.rtol = std::max(rtol, kFinest);
  // Adams interpolates at its own order. BDF must not look beyond the end, where rigid friction has
  // long come to rest; a one-step method's interpolation would be of order 5.
  options.interpolate = method == Method::cvode_adams;
  options.atol = Eigen::Map<const Eigen::VectorXd>(atol, states).cwiseMax(1e-300);
  return options;
}

std::vector<double> times_between(const std::vector<double>& t_s, double rate_rad_s,
                                  double largest_turn_rad, int& parts) {
  constexpr double kMostTimes = 2e7;
  const double apart_s = t_s.size() > 1 ? t_s[1] - t_s[0] : 0.0;
  const double wanted = std::ceil(apart_s * rate_rad_s / largest_turn_rad);
  if (wanted * static_cast<double>(t_s.size()) > kMostTimes)
    throw InputError(fmt::format(
        "run.until_s = {} s is too long to follow the angles of a body that turns at {:.3g} rad/s; "
        "shorten it, or take run.integrator = \"auto\" for a top",
        t_s.back(), rate_rad_s));
  parts = std::max(1, static_cast<int>(wanted));
  std::vector<double> fine{t_s.front()};
  for (std::size_t n = 1; n < t_s.size(); ++n) {
    for (int i = 1; i < parts; ++i) fine.push_back(t_s[n - 1] + (t_s[n] - t_s[n - 1]) * i / parts);
    fine.push_back(t_s[n]);
  }
  return fine;
}

Solution from_sundials(SundialsRun run) {
  Solution solution;
  solution.states = std::move(run.states);
  solution.outcome = run.outcome;
  solution.end_s = run.end_s;
  solution.statistics = {static_cast<int>(run.steps), static_cast<int>(run.failed),
                         static_cast<int>(run.evaluations)};
  return solution;
}

}  // namespace trochoid::model
