#pragma once
#include <ceres/manifold.h>

#include <memory>
#include <vector>

#include "problem/problem.hpp"

namespace trochoid::fitting {

/// How the minimiser steps where a top's axis starts near the vertical: tilt and azimuth are polar
/// coordinates there, in which the cost is anything but a bowl. Steps are taken in the cartesian
/// ones, theta (cos phi, sin phi) and their rates. Entries of the block that are held stay.
/// @param first, size  the block's place in u.
/// @returns null where this is not the case.
[[nodiscard]] std::unique_ptr<ceres::Manifold> pole_steps(const Problem& problem, int first,
                                                          int size, const Eigen::VectorXd& u,
                                                          const std::vector<int>& held);

}  // namespace trochoid::fitting
