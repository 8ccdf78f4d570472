#pragma once
#include <Eigen/Core>

namespace trochoid::fitting {

/// The way from a seen direction of a body's axis to a predicted one.
struct Departure {
  /// Along the meridian and the parallel of the seen one [rad]; as long as the angle between both.
  Eigen::Vector2d way = Eigen::Vector2d::Zero();
  Eigen::Matrix2d slope = Eigen::Matrix2d::Zero();  ///< by the predicted tilt and precession
  bool other_face = false;                          ///< the predicted axis was turned round
};

/// Directions as tilt and precession [rad]. An axis whose ends look alike is taken by the one that
/// lies nearer.
[[nodiscard]] Departure departure(const Eigen::Vector2d& seen, const Eigen::Vector2d& predicted,
                                  bool ends_alike);

}  // namespace trochoid::fitting
