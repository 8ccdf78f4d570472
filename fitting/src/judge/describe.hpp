#pragma once
#include "judge/statistics.hpp"
#include "problem/problem.hpp"
#include "trochoid/data/fit.hpp"
#include "trochoid/data/scene.hpp"

namespace trochoid::fitting {

/// Which stretches of which tracks were fitted.
void describe_arcs(const Problem& problem, data::Fit& fit);

/// Writes a solution into a fit: parameters with errors and notes, covariance, criteria, rank, what
/// follows from priors, and warnings. Values are those in problem.base.
void describe(const Problem& problem, const Solution& solution, const Uncertainty& error,
              const data::Scene& scene, data::Fit& fit);

}  // namespace trochoid::fitting
