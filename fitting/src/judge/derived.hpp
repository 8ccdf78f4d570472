#pragma once
#include "judge/statistics.hpp"
#include "problem/problem.hpp"
#include "trochoid/data/fit.hpp"

namespace trochoid::fitting {

/// Adds what follows from the fitted parameters and stated priors, with propagated errors.
/// Top: omega_s_rad_s, I_over_Is (from a spin mark, from I and Is, or from the body's shape) and
/// mass_kg (from I and gravity); nothing is derived that was not given or seen.
void add_derived_top(const Problem& problem, const Eigen::VectorXd& u,
                     const Eigen::MatrixXd& covariance, const data::Scene& scene, data::Fit& fit);

/// Whether a top's spin follows from the fitted b without a mark: from its moments, or its shape.
[[nodiscard]] bool spin_follows(const data::Scene& scene);

/// The velocity of a body that rolls when its record begins, which follows from its spin.
void add_derived_velocity(const Problem& problem, const Eigen::VectorXd& u,
                          const Eigen::MatrixXd& covariance, data::Fit& fit);

}  // namespace trochoid::fitting
