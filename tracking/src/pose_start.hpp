#pragma once
#include <vector>

#include "pose_motion.hpp"
#include "trochoid/tracking/detector.hpp"

namespace trochoid::tracking {

/// Poses whose silhouette could be the detected ellipse: tilts around what its axes say, both ways
/// the body can lean, best guesses first.
[[nodiscard]] std::vector<data::Pose<>> starts_from_detection(const data::Body& body,
                                                              const data::Support& support,
                                                              const data::Camera& camera,
                                                              const PoseMotion& motion,
                                                              const Detection& detection);

/// The other attitude with (nearly) the same silhouette: the axis mirrored at the line of sight.
[[nodiscard]] data::Pose<> mirrored(const data::Camera& camera, const PoseMotion& motion,
                                    const data::Pose<>& pose);

}  // namespace trochoid::tracking
