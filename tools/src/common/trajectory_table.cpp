#include "common/trajectory_table.hpp"

#include <fmt/format.h>

#include <cmath>

namespace trochoid::tools {

std::string error_words(const model::Trajectory& run) {
  const std::string of_axis = fmt::format("{:.1e} rad", run.error_estimate_rad);
  return std::isnan(run.error_estimate_m)
             ? of_axis
             : fmt::format("{:.1e} m, {}", run.error_estimate_m, of_axis);
}

data::Table trajectory_table(const model::Trajectory& run) {
  data::Table table;
  table.header = {
      {"trochoid trajectory 1", ""},
      {"made by", "trochoid " TROCHOID_VERSION},
      {"model", run.model},
      {"integrator", fmt::format("{}: {}", run.integrator, run.integrator_reason)},
      {"outcome", fmt::format("{} at t = {} s: {}", model::name(run.outcome), run.end_s,
                              model::sentence(run.outcome))},
      {"error estimate", error_words(run)},
      {"steps", fmt::format("{} accepted, {} rejected, {} evaluations", run.statistics.steps,
                            run.statistics.rejected, run.statistics.evaluations)}};
  for (const model::Event& event : run.events)
    table.header.emplace_back("event", fmt::format("{} at t = {} s", event.name, event.t_s));
  table.columns = run.columns;
  table.values = run.values;
  return table;
}

}  // namespace trochoid::tools
