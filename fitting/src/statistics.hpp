#pragma once
#include <Eigen/Core>
#include <vector>

#include "problem.hpp"
#include "trochoid/data/fit.hpp"
#include "whiteness.hpp"

namespace trochoid::fitting {

/// What the data say about the free parameters at a solution.
struct Uncertainty {
  Eigen::MatrixXd covariance;      ///< of the values (not of u), order of Problem::free
  Eigen::VectorXd plain_variance;  ///< were all residuals independent: what chi-square says
  std::vector<bool> identifiable;
  int rank = 0;  ///< directions known to better than 100 % (1 rad for angles)
  double condition = 0.0;
  std::vector<data::NullVector> null_vectors;
  Whiteness whiteness;  ///< of the worst channel
  std::vector<std::string> remarks;
};
/// Singular values of the Jacobian scaled by each parameter's natural size decide the rank;
/// correlated residuals widen the covariance by their effective sample size, few residuals by
/// Student's quantile, channel by channel (a sandwich of the channels' information matrices), and a
/// constant offset of half a sample's sigma is allowed for in every filmed channel whose residuals
/// hang together. Where the valley of chi-square bends within a standard deviation, the second
/// moment of the bend is added.
[[nodiscard]] Uncertainty uncertainty(const Problem& problem, const Eigen::VectorXd& u);

/// Largest change of a whitened residual when the integrator works a hundred times finer.
[[nodiscard]] double integration_error_sigma(const Problem& problem, const Eigen::VectorXd& u);

struct Criteria {
  double chi2 = 0.0;  ///< with the track's own sigmas, robust weights
  int rows = 0;
  double aicc = 0.0, bic = 0.0;
};
/// AICc and BIC with the noise as an estimated parameter; `inflation` shrinks the sample size.
[[nodiscard]] Criteria criteria(const Problem& problem, const Eigen::VectorXd& u, double inflation);

}  // namespace trochoid::fitting
