#pragma once
#include <Eigen/Core>

#include "linearise.hpp"

namespace trochoid::fitting {

/// Upper tail of the chi-square distribution with `dof` degrees of freedom (Wilson-Hilferty, good
/// to 0.002 for dof >= 5).
[[nodiscard]] double chi2_upper_tail(double chi2, double dof);

/// How residuals of one channel hang together in time.
struct Whiteness {
  double p_value = 1.0;  ///< Ljung-Box test of being white
  /// Variance factor of a mean: 1 + 2 sum of autocorrelations, >= 1; their sizes are summed where
  /// the residuals swing about zero.
  double inflation = 1.0;
  double correlation_time_s = 0.0;
};
/// @param series one column per coordinate, rows in time order with mean spacing step_s.
/// @param taken  parameters fitted to each column, which hide part of the correlation.
[[nodiscard]] Whiteness whiteness(const Eigen::MatrixXd& series, double step_s, double taken = 0.0);
/// Of a channel's residuals: arcs are tested separately and the worst counts.
[[nodiscard]] Whiteness channel_whiteness(const Problem& problem, const Linearised& all,
                                          Channel channel);

}  // namespace trochoid::fitting
