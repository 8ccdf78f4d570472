#pragma once
#include <Eigen/Core>
#include <cmath>

#include "trochoid/data/angle.hpp"

namespace trochoid::data {

/// Position and attitude of a cylinder in the table frame (z up, floor z = 0).
/// Euler angles 3-1-3: R(body -> table) = Rz(phi) Rx(theta) Rz(psi); theta = 0 lies flat.
template <class Scalar = double>
struct Pose {
  Eigen::Matrix<Scalar, 3, 1> centre_m = Eigen::Matrix<Scalar, 3, 1>::Zero();  ///< centre of mass
  Scalar theta_rad{0};
  Scalar phi_rad{0};
  Scalar psi_rad{0};
};

/// Symmetry axis k of a body in attitude (theta, phi).
template <class Scalar>
[[nodiscard]] Eigen::Matrix<Scalar, 3, 1> symmetry_axis(const Scalar& theta, const Scalar& phi) {
  using std::cos, std::sin;
  return {sin(phi) * sin(theta), -cos(phi) * sin(theta), cos(theta)};
}

/// The other pose in which a body of two equal faces looks the same: turned over about the axis of
/// its mark, which then shows the spin pi - psi - 2 mark.
/// @param mark_rad angle of the mark in the body, from body x [rad]; 0 without a mark.
template <class Scalar>
[[nodiscard]] Pose<Scalar> turned_over(Pose<Scalar> pose, double mark_rad) {
  pose.theta_rad = kPi - pose.theta_rad;
  pose.phi_rad = pose.phi_rad + kPi;
  pose.psi_rad = kPi - pose.psi_rad - 2.0 * mark_rad;
  return pose;
}

/// Height of the CoM of a cylinder whose lower rim touches the floor: R sin(theta) + h
/// |cos(theta)|.
template <class Scalar>
[[nodiscard]] Scalar height_on_floor_m(const Scalar& theta, double radius_m,
                                       double half_thickness_m) {
  using std::abs, std::cos, std::sin;
  return radius_m * sin(theta) + half_thickness_m * abs(cos(theta));
}

}  // namespace trochoid::data
