#include "link/second_look.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "geometry/pose_change.hpp"
#include "trochoid/data/pose_motion.hpp"

namespace trochoid::tracking {
namespace {

using Pose = data::Pose<>;

/// Where the body of frame i would have been one frame before it, moving as between its
/// neighbours; nothing if it is not seen on either side.
std::optional<Pose> one_frame_before(const std::vector<Glimpse>& glimpses, std::size_t i,
                                     bool alike) {
  const Pose& pose = glimpses[i].pose();
  const auto at = [&](std::size_t k) -> std::optional<Pose> {
    if (k >= glimpses.size() || !glimpses[k].posed()) return std::nullopt;
    return alike ? nearer_face(glimpses[k].pose(), pose, 0.0) : glimpses[k].pose();
  };
  const std::optional<Pose> before = at(i - 1), after = at(i + 1);
  if (!before && !after) return std::nullopt;
  const PoseChange change = before && after ? PoseChange(*before, pose, *after, PoseChange::kBeside)
                            : before        ? PoseChange(*before, pose, PoseChange::kBeside)
                                            : PoseChange(pose, *after, PoseChange::kBeside);
  return change.on(pose, -1.0);
}

}  // namespace

void measure_again(const Background& background, const BodyFinder& finder, std::size_t settled,
                   std::vector<Glimpse>& glimpses) {
  constexpr double kAsGood = 0.8;  // the first look had half the places and scatters
  constexpr double kNear = 0.25;
  const bool alike = finder.faces_look_alike();
  const std::vector<Glimpse> was = glimpses;
  on_all_cores(background, finder, glimpses.size(), [&](Measuring& measure, std::size_t i) {
    if (i < settled || !was[i].posed() || was[i].seen->attitude_doubtful) return;
    const std::optional<Pose> before = one_frame_before(was, i, alike);
    if (!before) return;
    const Sighting& seen = *was[i].seen;
    const Surroundings surroundings = surroundings_of(was, i);
    Sighting guess = seen;
    guess.pose->blur_px = surroundings.blur_px;
    auto again =
        measure(*was[i].frame, std::move(guess), Beside{*before, 1}, &surroundings.shading);
    if (!again || !again->pose || again->pose->support_px < kAsGood * seen.pose->support_px) return;
    const double off =
        std::max(between_axes(axis_of(again->pose->pose), axis_of(seen.pose->pose), alike),
                 (again->centre_px - seen.centre_px).norm() / seen.rim.semi_major_px());
    if (off > kNear) return;
    again->turned_rad = seen.turned_rad;
    glimpses[i].seen = std::move(again);
  });
}

}  // namespace trochoid::tracking
