#include "trochoid/model/simulate.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "factories.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/start_rates.hpp"
#include "trochoid/data/table.hpp"

namespace trochoid::model {

std::vector<double> output_times_s(const data::RunSettings& run) {
  if (!(run.until_s > 0.0) || !std::isfinite(run.until_s))
    throw InputError(fmt::format("run.until_s = {} must be greater than 0", run.until_s));
  if (!(run.rate_hz > 0.0) || !std::isfinite(run.rate_hz))
    throw InputError(fmt::format("run.rate_hz = {} must be greater than 0", run.rate_hz));
  // A grid whose last point misses until_s by rounding still has that point.
  const double last = std::floor(run.until_s * run.rate_hz * (1.0 + 1e-12) + 1e-9);
  if (last > data::Table::kMostRows) {
    throw InputError(
        fmt::format("run.until_s = {} at run.rate_hz = {} asks for {:.3g} rows; lower one",
                    run.until_s, run.rate_hz, last + 1.0));
  }
  std::vector<double> t_s(static_cast<std::size_t>(last) + 1);
  for (std::size_t n = 0; n < t_s.size(); ++n)
    t_s[n] = std::min(static_cast<double>(n) / run.rate_hz, run.until_s);
  return t_s;
}

void check_rates(const data::StartSettings& start) {
  if (const auto twice = data::rate_named_twice(start))
    throw InputError(fmt::format("start.{} and start.{} describe the same rate: give one of them",
                                 twice->first, twice->second));
}

const std::vector<std::string>& euler_columns() {
  static const std::vector<std::string> columns{
      "t_s",        "phi_rad", "theta_rad", "psi_rad", "dphi_rad_s", "dtheta_rad_s",
      "dpsi_rad_s", "x_m",     "y_m",       "z_m",     "energy_J"};
  return columns;
}

void end_where_unknown(const Eigen::VectorXd& apart_rad, Trajectory& trajectory) {
  constexpr double kUnknown_rad = 0.05;
  const Eigen::Index rows = std::min(apart_rad.size(), trajectory.values.rows());
  Eigen::Index known = 0;
  while (known < rows && apart_rad[known] <= kUnknown_rad) ++known;
  trajectory.error_estimate_rad = known > 0 ? apart_rad.head(known).maxCoeff() : 0.0;
  if (known == trajectory.values.rows()) return;
  trajectory.values.conservativeResize(known, Eigen::NoChange);
  trajectory.end_s = known > 0 ? trajectory.values(known - 1, 0) : 0.0;
  trajectory.outcome = Outcome::diverged;
  std::erase_if(trajectory.events, [&](const Event& e) { return e.t_s > trajectory.end_s; });
}

double finer(double tolerance) {
  return std::max(0.01 * tolerance, 2e-15);
}

namespace {

void check_integrator(const std::string& asked, const std::string& law) {
  const bool has_one = law == "top-euler" || law == "puck" || law == "pivot";
  if (has_one && asked != "auto" && asked != "dop853")
    throw NotOffered(fmt::format(
        "run.integrator = \"{}\": model \"{}\" runs with auto or dop853 alone", asked, law));
}

}  // namespace

Trajectory simulate(const data::Scene& scene) {
  if (!(scene.run.tolerance > 0.0) || scene.run.tolerance > 0.1) {
    throw InputError(
        fmt::format("run.tolerance = {} must lie between 0 and 0.1", scene.run.tolerance));
  }
  check_rates(scene.start);
  const std::string name = law_of(scene);
  check_integrator(scene.run.integrator, name);
  if (name == "free") return simulate_free(scene);
  if (name == "top") return simulate_top(scene);
  if (name == "top-euler") return simulate_top_euler(scene);
  if (name == "rolling" || name == "smooth" || name == "sliding") return simulate_rim(scene, name);
  if (name == "puck") return simulate_puck(scene);
  if (name == "pivot") return simulate_pivot(scene);
  throw InputError(
      fmt::format("model.name = \"{}\" cannot be simulated; models are free, top, top-euler, "
                  "rolling, smooth, sliding, "
                  "puck, pivot",
                  name));
}

}  // namespace trochoid::model
