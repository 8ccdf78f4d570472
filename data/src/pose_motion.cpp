#include "trochoid/data/pose_motion.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "trochoid/data/angle.hpp"

namespace trochoid::data {

Eigen::Vector3d node_line(const Pose<>& pose) {
  return {std::cos(pose.phi_rad), std::sin(pose.phi_rad), 0.0};
}

Eigen::Vector3d ascent(const Pose<>& pose) {
  const double c = std::cos(pose.theta_rad), s = std::sin(pose.theta_rad);
  return {-std::sin(pose.phi_rad) * c, std::cos(pose.phi_rad) * c, s};
}

Eigen::Vector3d axis_of(const Pose<>& pose) {
  return symmetry_axis(pose.theta_rad, pose.phi_rad);
}

void set_axis(const Eigen::Vector3d& axis, Pose<>& pose) {
  constexpr double kVertical = 1e-12;
  const double across = std::hypot(axis.x(), axis.y());
  pose.theta_rad = std::atan2(across, axis.z());
  if (across > kVertical) pose.phi_rad = std::atan2(axis.x(), -axis.y());
}

double lying_theta_rad(double theta_rad) {
  return theta_rad > 0.5 * kPi ? kPi : 0.0;
}

PoseMotion::PoseMotion(const Body& body, const Support& support, const Camera& camera)
    : radius_m_(body.radius_m),
      half_thickness_m_(body.half_thickness_m()),
      support_(support.kind),
      pivot_m_(support.pivot_m.value_or(Eigen::Vector3d::Zero())) {
  // An orthographic picture does not show how high a free body is.
  depth_free_ =
      support.kind == SupportKind::none && camera.projection == Camera::Projection::perspective;
  switch (support.kind) {
    case SupportKind::floor:
      count_ = 4;
      rotation_ = 2;
      break;
    case SupportKind::flat:
      count_ = 2;
      break;
    case SupportKind::pivot:
      count_ = 3;
      rotation_ = 0;
      break;
    case SupportKind::none:
      count_ = depth_free_ ? 5 : 4;
      rotation_ = depth_free_ ? 3 : 2;
      break;
  }
}

double PoseMotion::scale(int parameter) const {
  constexpr double kRotation_rad = 0.5;
  const bool rotates = rotation_ >= 0 && (parameter == rotation_ || parameter == rotation_ + 1);
  return rotates ? kRotation_rad : radius_m_;
}

PoseMotion::Velocities PoseMotion::velocities(const Pose<>& pose) const {
  Velocities v = Velocities::Zero(6, count_);
  const Eigen::Vector3d n = node_line(pose), e2 = ascent(pose);
  if (rotation_ >= 0) {
    v.col(rotation_).tail<3>() = n;
    v.col(rotation_ + 1).tail<3>() = e2;
  }
  if (support_ == SupportKind::pivot) {
    const Eigen::Vector3d k = symmetry_axis(pose.theta_rad, pose.phi_rad);
    const double along_m = (pose.centre_m - pivot_m_).dot(k);
    v.col(0).head<3>() = -along_m * e2;  // n x k
    v.col(1).head<3>() = along_m * n;    // e2 x k
    v.col(2).head<3>() = k;
    return v;
  }
  v(0, 0) = v(1, 1) = 1.0;
  if (depth_free_) v(2, 2) = 1.0;
  if (support_ == SupportKind::floor) {
    const double c = std::cos(pose.theta_rad), s = std::sin(pose.theta_rad);
    v(2, rotation_) = radius_m_ * c - std::copysign(half_thickness_m_, c) * s;
  }
  return v;
}

Pose<> PoseMotion::moved(const Pose<>& pose, const Step& step) const {
  Pose<> next = pose;
  double along_m = 0.0;
  if (support_ == SupportKind::pivot) {
    const Eigen::Vector3d k = symmetry_axis(pose.theta_rad, pose.phi_rad);
    along_m = (pose.centre_m - pivot_m_).dot(k) + step[2];
  } else {
    next.centre_m.head<2>() += step.head<2>();
    if (depth_free_) next.centre_m.z() += step[2];
  }
  if (rotation_ >= 0) {
    const Eigen::Vector3d k = symmetry_axis(pose.theta_rad, pose.phi_rad) -
                              step[rotation_] * ascent(pose) +
                              step[rotation_ + 1] * node_line(pose);
    set_axis(k.normalized(), next);
  }
  if (support_ == SupportKind::pivot)
    next.centre_m = pivot_m_ + along_m * symmetry_axis(next.theta_rad, next.phi_rad);
  return settled(next);
}

PoseMotion::Step PoseMotion::step_between(const Pose<>& from, const Pose<>& to) const {
  Step step = Step::Zero(count_);
  const Eigen::Vector3d axis = symmetry_axis(to.theta_rad, to.phi_rad);
  if (rotation_ >= 0) {
    const Eigen::Vector3d turned = axis - symmetry_axis(from.theta_rad, from.phi_rad);
    step[rotation_] = -turned.dot(ascent(to));
    step[rotation_ + 1] = turned.dot(node_line(to));
  }
  const Eigen::Vector3d moved = to.centre_m - from.centre_m;
  if (support_ == SupportKind::pivot) {
    step[2] = (to.centre_m - pivot_m_).norm() - (from.centre_m - pivot_m_).norm();
  } else {
    step.head<2>() = moved.head<2>();
    if (depth_free_) step[2] = moved.z();
  }
  return step;
}

Pose<> PoseMotion::settled(Pose<> pose) const {
  switch (support_) {
    case SupportKind::flat:
      pose.theta_rad = lying_theta_rad(pose.theta_rad);
      pose.centre_m.z() = half_thickness_m_;
      break;
    case SupportKind::floor:
      pose.centre_m.z() = height_on_floor_m(pose.theta_rad, radius_m_, half_thickness_m_);
      break;
    case SupportKind::pivot: {
      const Eigen::Vector3d axis = pose.centre_m - pivot_m_;
      if (axis.norm() > 1e-9) set_axis(axis.normalized(), pose);
      break;
    }
    case SupportKind::none:
      break;
  }
  return pose;
}

bool is_on_a_pin(const Body& body, const Support& support, const Pose<>& pose) {
  return support.kind == SupportKind::pivot && support.pivot_m &&
         (pose.centre_m - *support.pivot_m).norm() < body.half_thickness_m();
}

}  // namespace trochoid::data
