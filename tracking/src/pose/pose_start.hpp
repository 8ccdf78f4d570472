#pragma once
#include <optional>
#include <vector>

#include "pose/edge_map.hpp"
#include "trochoid/data/pose_motion.hpp"
#include "trochoid/tracking/outline_fit.hpp"

namespace trochoid::tracking {

/// Sought wherever a body of this size could be inside the detection: poses whose silhouette runs
/// along sharp edges of the picture, best first, no two alike. The detection may hold a shadow or
/// a hand along with the body; its outline and its centre do not matter.
/// @param view with a detection.
[[nodiscard]] std::vector<data::Pose<>> starts_from_edges(const data::Body& body,
                                                          const data::Support& support,
                                                          const data::Camera& camera,
                                                          const data::PoseMotion& motion,
                                                          const OutlineView& view);

/// The other attitude with (nearly) the same silhouette: the axis mirrored at the line of sight.
[[nodiscard]] data::Pose<> mirrored(const data::Camera& camera, const data::PoseMotion& motion,
                                    const data::Pose<>& pose);

/// On which side of the line of sight a body tilts, of another attitude.
enum class Side { same, mirrored };

/// The attitude whose near face alone is outlined as the whole body is at this pose: what is taken
/// for the body's outline is its face's where the wall beside it is about as bright as the floor.
/// Nothing where there is none; about a pivot on the same side only.
[[nodiscard]] std::optional<data::Pose<>> face_outlined_like(const data::Body& body,
                                                             const data::Camera& camera,
                                                             const data::PoseMotion& motion,
                                                             const data::Pose<>& pose, Side side);

/// The reverse, on the same side: the attitude whose whole outline is as that of the near face
/// alone is at this pose. The lower edge of its wall has been taken for that of its face.
[[nodiscard]] std::optional<data::Pose<>> outlined_like_face(const data::Body& body,
                                                             const data::Camera& camera,
                                                             const data::PoseMotion& motion,
                                                             const data::Pose<>& pose);

}  // namespace trochoid::tracking
