#pragma once
#include <Eigen/Core>
#include <vector>

#include "observe/noise.hpp"
#include "problem/linearise.hpp"

namespace trochoid::fitting {

/// Upper tail of the chi-square distribution with `dof` degrees of freedom (Wilson-Hilferty: good
/// to 0.002 for dof >= 5; a tail of 1e-6 is right within a factor of 2 for dof >= 10, of 4 for 1).
[[nodiscard]] double chi2_upper_tail(double chi2, double dof);

/// How residuals of one channel hang together in time.
struct Whiteness {
  double p_value = 1.0;  ///< Ljung-Box test of being white
  /// Variance of a long mean over that of independent residuals; 1 where they may be white.
  double inflation = 1.0;
  double correlation_time_s = 0.0;
};

/// By how much of its noise chi-square would fall, per parameter, if each arc's second half had
/// parameters of its own (Chow, Econometrica 28, 591, 1960): 1 +- sqrt(2/parameters) where the
/// model is right.
struct Drift {
  double gain = 1.0;
  double parameters = 0.0;  ///< 0: nothing to tell from
};

/// What the residuals of one channel say of its noise.
struct ChannelNoise {
  Channel channel = Channel::position;
  Whiteness whiteness;
  std::vector<NoiseKind> kinds;
  /// Factor of the variance for what hangs together otherwise, say swings.
  double excess = 1.0;
  double minus2_log_likelihood = 0.0;  ///< as in NoiseEvidence
  Drift drift;
};
/// The kinds of noise are those of all arcs together: one tracker made them.
/// @param scaled     derivatives of all residuals, `all.jacobian` up to the scale of its columns.
/// @param unit_steps columns along which `scaled` has unit and orthogonal derivatives.
[[nodiscard]] ChannelNoise channel_noise(const Problem& problem, const Linearised& all,
                                         Channel channel, const Eigen::MatrixXd& scaled,
                                         const Eigen::MatrixXd& unit_steps);

/// J^T R J of the channel's rows of `scaled`, R the covariance matrix of its residuals.
[[nodiscard]] Eigen::MatrixXd seen_through(const Problem& problem, const Linearised& all,
                                           const ChannelNoise& noise,
                                           const Eigen::MatrixXd& scaled);

}  // namespace trochoid::fitting
