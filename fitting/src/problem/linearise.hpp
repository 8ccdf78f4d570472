#pragma once
#include <Eigen/Core>
#include <vector>

#include "problem/problem.hpp"

namespace trochoid::fitting {

/// Residuals of all arcs and their derivatives by the values (not by u); priors are further rows.
/// Of parameters that are kept (kept_parameters) the part that the others can take up.
struct Linearised {
  Eigen::MatrixXd jacobian;
  Eigen::VectorXd residuals;
  std::vector<Channel> channel;  ///< of each row; priors are counted to no channel
  std::vector<int> arc;          ///< -1 for priors
};
/// Places among Problem::free of what is held at what is known of the camera beforehand.
[[nodiscard]] std::vector<int> kept_parameters(const Problem& problem);

/// @throws NumericalError where the model has no prediction.
[[nodiscard]] Linearised linearise(const Problem& problem, const Eigen::VectorXd& u);

/// An orthonormal basis of what the parameters can do to the residuals: as many rows.
[[nodiscard]] Eigen::MatrixXd reachable(const Linearised& all);

/// Residuals of all arcs, without priors; false where the model has no prediction.
[[nodiscard]] bool all_residuals(const Problem& problem, const Eigen::VectorXd& u,
                                 Eigen::VectorXd& residuals);

}  // namespace trochoid::fitting
