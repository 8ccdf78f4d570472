#pragma once
#include "problem/problem.hpp"
#include "trochoid/data/fit.hpp"

namespace trochoid::fitting {

/// Steady precession shows l sin(theta) and the rate only: a, b and l need nutation, but for l
/// where the tilt was seen. When a circle about the pivot at one tilt (with drag: both drift)
/// explains the measurements as well as the fitted top does, declares these and, unless seen, theta
/// not identifiable and says what is known instead.
void admit_steady_precession(const Problem& problem, const Eigen::VectorXd& u, data::Fit& fit);

}  // namespace trochoid::fitting
