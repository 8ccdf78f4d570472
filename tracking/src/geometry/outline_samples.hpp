#pragma once
#include <Eigen/Core>
#include <array>
#include <vector>

#include "trochoid/data/outline.hpp"
#include "trochoid/data/pose_motion.hpp"

namespace trochoid::tracking {

/// Whether an edge borders the bore of a ring rather than its outside.
[[nodiscard]] bool is_bore(data::OutlinePoint::Edge edge);

/// Whether a point of an outline tells the body from what is not: on its silhouette, or on a border
/// of its face, which may be the clearer.
/// @param point an OutlineSample or a data::OutlinePoint.
template <class Point>
[[nodiscard]] bool tells_outline(const Point& point) {
  return point.silhouette || point.edge == data::OutlinePoint::Edge::border;
}

/// A point of the predicted outline with what a fit needs to know about it.
struct OutlineSample {
  data::OutlinePoint::Edge edge;
  bool silhouette;
  Eigen::Vector2d image_px, normal_px;
  double arc_px;
  double height_px;              ///< above the floor, at the scale of the picture there
  double inside_px, outside_px;  ///< along the normal to the next edge of the body itself
  /// How far the outline moves along its normal per unit of each parameter.
  using Motion =
      Eigen::Matrix<double, 1, Eigen::Dynamic, Eigen::RowMajor, 1, data::PoseMotion::kMost>;
  Motion motion;
  Motion near_motion;  ///< of the near face's rim across the wall, along the same normal; or empty
};

/// How a body moves while the rows of a picture are read one after the other.
struct MotionInReadout {
  /// OutlineView::readout_per_px; 0 where they are read at once.
  Eigen::Vector2d frames_per_px = Eigen::Vector2d::Zero();
  /// Speed and acceleration, in small motions per frame and per frame squared; empty: not known.
  data::PoseMotion::Step per_frame{}, per_frame2{};
};

/// The outline as it is seen: that of the body when the row of its centre is read, each point moved
/// on, or back, to when its own row is.
void read_in_turn(const MotionInReadout& motion, const Eigen::Vector2d& centre_px,
                  std::vector<OutlineSample>& outline);

/// Samples the visible outline about every `step_px`. A smooth body's apparent contour moves along
/// its normal like the material under it, so one formula serves rims and wall alike.
[[nodiscard]] std::vector<OutlineSample> outline_samples(const data::Body& body,
                                                         const data::Pose<>& pose,
                                                         const data::Camera& camera,
                                                         const data::PoseMotion& motion,
                                                         double step_px);

/// Where an outline, sampled sparsely, crosses a row of pixels (where it runs up or down rather
/// than across) or a column.
struct Crossing {
  size_t before;  ///< the sample before; the next one is behind
  double part;    ///< of the way between them
  bool row;       ///< or a column
  Eigen::Vector2d image_px = Eigen::Vector2d::Zero(), normal_px = Eigen::Vector2d::Zero();
  double curvature_per_px = 0.0;  ///< of the outline, > 0 where the body is convex
};

/// Neighbouring crossings of rows, or of columns, looked at together.
struct Crossings {
  static constexpr int kMost = 2;
  int count = 0;
  std::array<Crossing, kMost> at;
};

/// The outline at crossings of one in `every` rows and columns, interpolated.
[[nodiscard]] std::vector<OutlineSample> cross_pixels(const std::vector<OutlineSample>& outline,
                                                      int every, std::vector<Crossings>& crossings);

/// Axis pointing out of the face towards the camera.
[[nodiscard]] Eigen::Vector3d axis_towards(const data::Camera& camera, const data::Pose<>& pose);
/// Unit vector from a point of the table frame to the camera.
[[nodiscard]] Eigen::Vector3d direction_to(const data::Camera& camera, const Eigen::Vector3d& at_m);

}  // namespace trochoid::tracking
