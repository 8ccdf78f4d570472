#pragma once
#include "judge/statistics.hpp"
#include "problem/problem.hpp"
#include "trochoid/data/fit.hpp"

namespace trochoid::fitting {

/// Tells of each prior that is more than three standard deviations from what the tracks say without
/// it, what residuals have in common allowed for, by the derivatives at the minimum. Beyond five
/// the verdict is doubtful: neither the prior nor the tracks are explained.
/// @param u  a minimum, by which the problem's weights are set.
void doubt_if_priors_contradict(const Problem& problem, const Eigen::VectorXd& u,
                                const Uncertainty& error, data::Fit& fit);

/// The same of values other than 0 that [fit] fixes, by a fit in which one of them is free. Those
/// of a start are looked at in a single arc only.
void doubt_if_fixed_contradict(const Problem& problem, const Eigen::VectorXd& u,
                               const data::FitSettings& settings, data::Fit& fit);

/// The same of bounds that a value has come to, by a fit without that bound.
/// @param error  of that minimum.
void doubt_if_bounds_contradict(const Problem& problem, const Eigen::VectorXd& u,
                                const Uncertainty& error, const data::FitSettings& settings,
                                data::Fit& fit);

/// Tells where several tracks ask for different values of the parameters that they share, by the
/// derivatives at the minimum: which track, and of which parameter above all. The verdict is
/// doubtful then, but of filmed tracks only where that says more than trackers err with the motion.
/// Of pucks doubt_if_frictions_differ() says more.
/// @param u  a minimum, by which the problem's weights are set.
void doubt_if_tracks_differ(const Problem& problem, const Eigen::VectorXd& u,
                            const Uncertainty& error, data::Fit& fit);

}  // namespace trochoid::fitting
