#pragma once
#include "problem/problem.hpp"
#include "trochoid/data/fit.hpp"

namespace trochoid::fitting {

/// Steady precession shows l sin(theta) and the rate only: a, b and l need nutation. When a circle
/// about the pivot (with drag: one that drifts) explains the positions as well as the fitted top
/// does, declares a, b, l and theta not identifiable and says what is known instead. Does nothing
/// where the tilt was seen.
void admit_steady_precession(const Problem& problem, const Eigen::VectorXd& u, data::Fit& fit);

}  // namespace trochoid::fitting
