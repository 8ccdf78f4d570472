#pragma once
#include <vector>

#include "problem.hpp"
#include "trochoid/data/fit.hpp"

namespace trochoid::fitting {

/// Profile likelihood of every free parameter but the initial angles and places: it is held at
/// values ever further from the solution and everything else fitted again, until chi-square has
/// risen by the 95 % quantile times sigma^2 / plain_variance (residuals that hang together let it
/// rise too fast), or the parameter has moved by four decades (a hundred standard deviations where
/// it is not logarithmic).
/// @param sigma  standard deviations of the free parameters' values.
/// @param plain_variance  what they would be squared, were all residuals independent.
[[nodiscard]] std::vector<data::Profile> profiles(const Problem& problem, const Solution& solution,
                                                  const Eigen::VectorXd& sigma,
                                                  const Eigen::VectorXd& plain_variance,
                                                  int threads);

}  // namespace trochoid::fitting
