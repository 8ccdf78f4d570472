#include "judge/path_steps.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "trochoid/data/path_step.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::fitting {

std::string in_track(const Problem& problem, const ArcData& arc) {
  const bool several = std::any_of(problem.arcs.begin(), problem.arcs.end(),
                                   [&](const ArcData& other) { return other.track != arc.track; });
  return several ? fmt::format(" in track {}", arc.track + 1) : "";
}

namespace {

/// What a position is uncertain by, as a rule.
double usual_position_sigma_m(const ArcData& arc) {
  std::vector<double> sigmas_m;
  for (const Reading& reading : arc.readings)
    if (reading.channel == Channel::position)
      sigmas_m.push_back(std::sqrt(2.0) / reading.whitener.norm());
  return data::median(std::move(sigmas_m));
}

}  // namespace

void tell_steps_of_path(const Problem& problem, data::Fit& fit) {
  constexpr double kClear = 0.1;  // times that jitter by a third of a frame come to more
  constexpr double kLeastSigmas = 3.0;
  for (const ArcData& arc : problem.arcs) {
    if (arc.observable_index(model::Observable::x_m) < 0) continue;
    const auto steps = data::clear_path_steps(arc.t_s, arc.positions_m(), kClear,
                                              kLeastSigmas * usual_position_sigma_m(arc));
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
