#pragma once
#include <Eigen/Core>

/// Motion whose jerk is white noise, as a Kalman filter sees it: (value, rate, acceleration).
namespace trochoid::data {

/// Takes a state `dt` further.
[[nodiscard]] inline Eigen::Matrix3d white_jerk_transition(double dt) {
  Eigen::Matrix3d move = Eigen::Matrix3d::Identity();
  move(0, 1) = move(1, 2) = dt;
  move(0, 2) = 0.5 * dt * dt;
  return move;
}

/// Covariance that jerk of spectral density 1 adds over `dt`.
[[nodiscard]] inline Eigen::Matrix3d white_jerk_covariance(double dt) {
  const double dt2 = dt * dt, dt3 = dt2 * dt;
  Eigen::Matrix3d added;
  added << dt3 * dt2 / 20.0, dt2 * dt2 / 8.0, dt3 / 6.0,  //
      dt2 * dt2 / 8.0, dt3 / 3.0, dt2 / 2.0,              //
      dt3 / 6.0, dt2 / 2.0, dt;
  return added;
}

}  // namespace trochoid::data
