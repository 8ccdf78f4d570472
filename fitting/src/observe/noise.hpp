#pragma once
#include <Eigen/Core>
#include <vector>

namespace trochoid::fitting {

/// One series of residuals in time order, and what the fitted parameters take from it.
struct NoiseSeries {
  Eigen::VectorXd residual;
  Eigen::MatrixXd taken;  ///< rows as `residual`
};

/// Series that share their parameters, as the coordinates of one path do: as many columns taken
/// from each, independent of each other over all of them together.
using NoiseGroup = std::vector<NoiseSeries>;

/// White noise plus an autoregressive process of first order, of unit variance together: the
/// autocorrelation is share rho^lag.
struct NoiseKind {
  double share = 0.0;  ///< of the variance, of the autoregressive process
  double rho = 0.0;
  double variance = 1.0;   ///< of one residual
  double posterior = 1.0;  ///< probability given the residuals; all kinds together: 1

  /// Variance of a long mean over that of independent residuals of the same size.
  [[nodiscard]] double inflation() const { return 1.0 + 2.0 * share * rho / (1.0 - rho); }
};

/// What residuals say of their noise.
struct NoiseEvidence {
  std::vector<NoiseKind> kinds{{}};  ///< those the residuals allow
  /// Twice the negative logarithm of the greatest likelihood of the residuals as they are, without
  /// its constant.
  double minus2_log_likelihood = 0.0;
};

/// The kinds of noise the residuals allow, with how likely each is. Residuals are smaller and
/// whiter than the noise by what the parameters follow of it; the likelihood is the restricted one
/// (Harville, J. Am. Stat. Assoc. 72, 320, 1977), which allows for that.
[[nodiscard]] NoiseEvidence noise_evidence(const std::vector<NoiseGroup>& groups);

/// X^T R X with R the correlation matrix of a kind of noise, rows of X in time order.
[[nodiscard]] Eigen::MatrixXd seen_through(const NoiseKind& kind, const Eigen::MatrixXd& x);

/// The rows with the correlation taken out: independent and of unit variance if the kind is right.
[[nodiscard]] Eigen::MatrixXd decorrelated(const NoiseKind& kind, const Eigen::MatrixXd& x);

}  // namespace trochoid::fitting
