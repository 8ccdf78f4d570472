#pragma once
#include <Eigen/Core>
#include <vector>

#include "observe/observations.hpp"
#include "trochoid/data/angle.hpp"

namespace trochoid::fitting {

/// Of all angles whole turns apart from this one, that nearest to another one.
[[nodiscard]] double continued(double angle_rad, double from_rad);

/// Angles without their jumps by whole turns, each continued from the one before along the latest
/// rates, not merely to within half a turn of it. The first rates are the angles' own: a series
/// that counts turns knows of more than half of one from sample to sample.
/// @param t_s  increasing, as many; whatever the angle goes with.
[[nodiscard]] std::vector<double> continued_along_rate(const std::vector<double>& t_s,
                                                       const std::vector<double>& angle_rad);

/// Readings of one angle and the times they belong to, continued over its jumps: a spin along its
/// rate, the others by less than half a turn.
struct AngleSeries {
  std::vector<double> t_s, angle_rad;

  [[nodiscard]] Eigen::Map<const Eigen::VectorXd> angles() const {
    return {angle_rad.data(), static_cast<Eigen::Index>(angle_rad.size())};
  }
};
[[nodiscard]] AngleSeries angle_series(const ArcData& arc, Channel channel);

/// Precession of an axis that leans towards these places (n x 2, from its pivot), from one to the
/// next by less than half a turn [rad].
[[nodiscard]] Eigen::VectorXd precessions(const Eigen::MatrixX2d& places);

}  // namespace trochoid::fitting
