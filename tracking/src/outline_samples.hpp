#pragma once
#include <Eigen/Core>
#include <vector>

#include "pose_motion.hpp"
#include "trochoid/data/outline.hpp"

namespace trochoid::tracking {

/// A point of the predicted outline with what a fit needs to know about it.
struct OutlineSample {
  data::OutlinePoint::Edge edge;
  bool silhouette;
  Eigen::Vector2d image_px, normal_px;
  double arc_px;
  double inside_px, outside_px;  ///< along the normal to the next edge of the body itself
  /// How far the outline moves along its normal per unit of each parameter.
  Eigen::Matrix<double, 1, Eigen::Dynamic, Eigen::RowMajor, 1, PoseMotion::kMost> motion;
};

/// Samples the visible outline about every `step_px`. A smooth body's apparent contour moves along
/// its normal like the material under it, so one formula serves rims and wall alike.
[[nodiscard]] std::vector<OutlineSample> outline_samples(const data::Body& body,
                                                         const data::Pose<>& pose,
                                                         const data::Camera& camera,
                                                         const PoseMotion& motion, double step_px);

/// Axis pointing out of the face towards the camera.
[[nodiscard]] Eigen::Vector3d axis_towards(const data::Camera& camera, const data::Pose<>& pose);
/// Unit vector from a point of the table frame to the camera.
[[nodiscard]] Eigen::Vector3d direction_to(const data::Camera& camera, const Eigen::Vector3d& at_m);

}  // namespace trochoid::tracking
