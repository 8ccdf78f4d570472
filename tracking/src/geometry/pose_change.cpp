#include "geometry/pose_change.hpp"

#include <algorithm>
#include <cmath>

#include "trochoid/data/angle.hpp"
#include "trochoid/data/pose_motion.hpp"

namespace trochoid::tracking {

PoseChange::PoseChange(const Pose& from, const Pose& to, double least_sine)
    : tilt_rad_(to.theta_rad - from.theta_rad),
      precession_rad_(data::wrapped(to.phi_rad - from.phi_rad)),
      axis_(axis_of(to) - axis_of(from)),
      shift_m_(to.centre_m - from.centre_m),
      steep_(std::min(std::sin(from.theta_rad), std::sin(to.theta_rad)) < least_sine) {}

PoseChange::PoseChange(const Pose& before, const Pose& now, const Pose& after, double least_sine)
    : PoseChange(before, now, least_sine) {
  const PoseChange late(now, after, least_sine);
  tilt_rad_ = 0.5 * (tilt_rad_ + late.tilt_rad_);
  precession_rad_ = 0.5 * (precession_rad_ + late.precession_rad_);
  axis_ = 0.5 * (axis_ + late.axis_);
  shift_m_ = 0.5 * (shift_m_ + late.shift_m_);
  steep_ = steep_ || late.steep_;
}

PoseChange::Pose PoseChange::on(const Pose& pose, double share, Centre centre) const {
  Pose next = pose;
  if (steep_) {
    set_axis(axis_straight_on(pose, share), next);
    // The same azimuth, without a leap of a turn.
    next.phi_rad += data::kTurn * std::round((pose.phi_rad - next.phi_rad) / data::kTurn);
  } else {
    next.theta_rad = std::clamp(pose.theta_rad + share * tilt_rad_, 0.0, data::kPi);
    next.phi_rad += share * precession_rad_;
  }
  next.centre_m += shift_m(share, steep_ ? Centre::straight : centre);
  return next;
}

Eigen::Vector3d PoseChange::axis_straight_on(const Pose& pose, double share) const {
  return (axis_of(pose) + share * axis_).normalized();
}

Eigen::Vector3d PoseChange::axis_turning_on(const Pose& pose, double share) const {
  return data::symmetry_axis(pose.theta_rad + share * tilt_rad_,
                             pose.phi_rad + share * precession_rad_);
}

Eigen::Vector3d PoseChange::shift_m(double share, Centre centre) const {
  if (centre == Centre::straight) return share * shift_m_;
  // From the middle of the one way to the middle of the other.
  return share * data::turned_about_vertical(shift_m_, 0.5 * (1.0 + share) * precession_rad_);
}

bool is_steep(const data::Pose<>& pose) {
  return std::sin(pose.theta_rad) < PoseChange::kBeyond;
}

data::Pose<> nearer_face(const data::Pose<>& pose, const data::Pose<>& reference, double mark_rad) {
  if (axis_of(pose).dot(axis_of(reference)) >= 0.0) return pose;
  return data::turned_over(pose, mark_rad);
}

}  // namespace trochoid::tracking
