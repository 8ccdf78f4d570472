#pragma once
#include <Eigen/Core>
#include <span>
#include <vector>

namespace trochoid::fitting {

/// The samples of a path that one body can have visited in turn: a chain that leaves out wrong
/// places, single ones and whole runs of them, even where a run is smooth in itself.
///
/// Each sample of the chain is predicted from those before it by a Kalman filter that knows
/// position, velocity and acceleration, with white jerk; of all chains the one that gains most is
/// taken (dynamic programming over the sample before). A sample gains what is left of a fixed
/// reward after its penalty. How strong the jerk is, the gain of the whole chain tells.
/// @param t_s      increasing.
/// @param xy_m     n x 2.
/// @param sigma_m  stated noise of each coordinate per sample, > 0; its scale may be too small.
/// @returns indices in ascending order; all where there are fewer than 12 samples or the path bends
/// evenly. What lies beyond a chain that ends long before the path does is another kind of motion
/// and has a chain of its own; where that is short or less than half dense, all of it is kept.
[[nodiscard]] std::vector<int> consistent_path(std::span<const double> t_s,
                                               const Eigen::MatrixX2d& xy_m,
                                               std::span<const double> sigma_m);

}  // namespace trochoid::fitting
