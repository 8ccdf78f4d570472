#include "judge/path_steps.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "trochoid/data/path_step.hpp"

namespace trochoid::fitting {

std::string in_track(const Problem& problem, const ArcData& arc) {
  const bool several = std::any_of(problem.arcs.begin(), problem.arcs.end(),
                                   [&](const ArcData& other) { return other.track != arc.track; });
  return several ? fmt::format(" in track {}", arc.track + 1) : "";
}

void tell_steps_of_path(const Problem& problem, data::Fit& fit) {
  constexpr double kClear = 0.1;  // times that jitter by a third of a frame come to more
  for (const ArcData& arc : problem.arcs) {
    if (arc.observable_index(model::Observable::x_m) < 0) continue;
    const auto steps = data::clear_path_steps(arc.t_s, arc.positions_m(), kClear);
    if (steps.empty()) continue;
    const bool all_missing = std::all_of(
        steps.begin(), steps.end(), [](const data::PathStep& step) { return step.frames > 0.0; });
    fit.warnings.push_back(fmt::format(
        "the body goes on by whole frames at once{} ({}): did the recorder drop pictures, or write "
        "some twice, and the times not show it?{}",
        in_track(problem, arc), data::words_of(steps, arc.t_s),
        all_missing ? " To track it again with [camera] missing_frames puts that right" : ""));
  }
}

}  // namespace trochoid::fitting
