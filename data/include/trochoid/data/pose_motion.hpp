#pragma once
#include <Eigen/Geometry>

#include "trochoid/data/body.hpp"
#include "trochoid/data/camera.hpp"
#include "trochoid/data/pose.hpp"
#include "trochoid/data/scene.hpp"

namespace trochoid::data {

/// @returns `v` after a turn about the vertical of the table.
[[nodiscard]] inline Eigen::Vector3d turned_about_vertical(const Eigen::Vector3d& v,
                                                           double angle_rad) {
  return Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitZ()) * v;
}

/// The ways a body can move under its support, as small motions about a pose: translations of the
/// table frame [m], rotations about the node line and about the direction of steepest ascent [rad]
/// (regular at theta = 0, where phi is not), and the distance along the axis from a pivot [m].
class PoseMotion {
 public:
  static constexpr int kMost = 5;
  using Step = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMost, 1>;
  /// Per unit of each parameter: velocity of the centre (rows 0-2), rotation vector (rows 3-5).
  using Velocities = Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, kMost>;

  /// @param body  a disc or ring, radius_m > 0.
  /// @param camera  without a support, only one with perspective shows how high the body is.
  PoseMotion(const Body& body, const Support& support, const Camera& camera);

  [[nodiscard]] int count() const { return count_; }
  /// Index of the rotation about the node line; the one about e2 follows. -1: the attitude is
  /// fixed.
  [[nodiscard]] int rotation() const { return rotation_; }
  /// The axis goes through a pivot.
  [[nodiscard]] bool pivoted() const { return support_ == SupportKind::pivot; }
  /// That pivot; the origin of the table where the scene names none.
  [[nodiscard]] const Eigen::Vector3d& pivot_m() const { return pivot_m_; }
  /// Standard deviation [m or rad] of what a parameter could be at most; keeps the fit regular
  /// where the picture says nothing.
  [[nodiscard]] double scale(int parameter) const;
  /// At a pose: m/s and rad/s for a parameter that changes by one a second.
  [[nodiscard]] Velocities velocities(const Pose<>& pose) const;
  /// The pose after a step from this one, put where the support wants it; psi stays.
  [[nodiscard]] Pose<> moved(const Pose<>& pose, const Step& step) const;
  /// The small motion that leads from one pose to another, to first order.
  [[nodiscard]] Step step_between(const Pose<>& from, const Pose<>& to) const;
  /// Puts a pose where the support wants it: height on the floor, flat, axis through the pivot.
  [[nodiscard]] Pose<> settled(Pose<> pose) const;

 private:
  double radius_m_, half_thickness_m_;
  SupportKind support_;
  Eigen::Vector3d pivot_m_;
  int count_ = 0, rotation_ = -1;
  bool depth_free_ = false;
};

/// e2 of the node frame: steepest ascent in the plane of the disc; unit length, table frame.
[[nodiscard]] Eigen::Vector3d ascent(const Pose<>& pose);
/// e1 of it: the level line in the plane of the disc; unit length.
[[nodiscard]] Eigen::Vector3d node_line(const Pose<>& pose);
/// symmetry_axis() of a pose; unit length.
[[nodiscard]] Eigen::Vector3d axis_of(const Pose<>& pose);
/// Gives a pose theta and phi of a direction of unit length; phi is kept where that is vertical.
void set_axis(const Eigen::Vector3d& axis, Pose<>& pose);

/// Tilt of a body that lies on the face it is nearer to lying on: 0 or pi [rad].
[[nodiscard]] double lying_theta_rad(double theta_rad);

/// Whether a body is held at its own middle: its pivot lies within half its thickness of the centre
/// of this pose [m].
[[nodiscard]] bool is_on_a_pin(const Body& body, const Support& support, const Pose<>& pose);

}  // namespace trochoid::data
