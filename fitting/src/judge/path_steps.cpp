#include "judge/path_steps.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "trochoid/data/path_step.hpp"

namespace trochoid::fitting {

void tell_steps_of_path(const Problem& problem, data::Fit& fit) {
  constexpr std::size_t kFew = 6, kRarely = 40;  // else times jitter, or the path has corners
  for (const ArcData& arc : problem.arcs) {
    if (arc.observable_index(model::Observable::x_m) < 0) continue;
    const auto steps = data::path_steps(arc.t_s, arc.positions_m());
    if (steps.empty() || steps.size() > std::min(kFew, arc.t_s.size() / kRarely)) continue;
    fit.warnings.push_back(fmt::format(
        "the body goes on by whole frames at once ({}): did the recorder drop pictures, or write "
        "some twice, and the times not show it? [camera] missing_frames puts that right",
        data::words_of(steps, arc.t_s)));
  }
}

}  // namespace trochoid::fitting
