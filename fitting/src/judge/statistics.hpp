#pragma once
#include <Eigen/Core>
#include <vector>

#include "judge/whiteness.hpp"
#include "problem/problem.hpp"
#include "trochoid/data/fit.hpp"

namespace trochoid::fitting {

/// What the data say about the free parameters at a solution.
struct Uncertainty {
  Eigen::MatrixXd covariance;  ///< of the values (not of u), order of Problem::free
  /// How many times too fast chi-square, which takes residuals for independent and free of common
  /// offsets, rises along each parameter; at least 1.
  Eigen::VectorXd chi2_inflation;
  std::vector<bool> identifiable;
  int rank = 0;  ///< directions known to better than 100 % (1 rad for angles)
  double condition = 0.0;
  std::vector<data::NullVector> null_vectors;
  Whiteness whiteness;  ///< of the worst channel
  Drift drift;          ///< likewise
  /// Times the error bars are wider than those of independent residuals, typically, for what these
  /// have in common; offsets of a whole record, which no residuals show, not counted.
  double widened = 1.0;
  Eigen::MatrixXd of_camera;  ///< what the camera's calibration has of the covariance
  /// Twice the negative logarithm of the residuals' likelihood in units of the track's own sigmas,
  /// their correlation allowed for, without its constant.
  double minus2_log_likelihood = 0.0;
};

/// The size at which a parameter of a free index counts as "known to 100 %" [its unit].
[[nodiscard]] double natural_size(const Problem& problem, int index, const Eigen::VectorXd& u);

/// Variances of parameters if those at some places were exact.
[[nodiscard]] Eigen::VectorXd variances_given(const Eigen::MatrixXd& covariance,
                                              const std::vector<int>& known);

/// Singular values of the Jacobian scaled by each parameter's natural size decide the rank. The
/// covariance is the sandwich of least squares in noise that hangs together: each parameter is
/// widened by the noise at the frequencies it acts at, averaged over the kinds of noise that the
/// residuals of each channel allow (noise.hpp), and by Student's quantile where these are few.
/// Every filmed channel may be off altogether, in all recordings alike, by half of what its
/// readings scatter by or a quarter of their own sigmas, positions also to the side the face that
/// is seen looks to; and the camera as its calibration allows (camera_error.hpp). Where the valley
/// of chi-square bends within a standard deviation, the second moment of the bend is added.
[[nodiscard]] Uncertainty uncertainty(const Problem& problem, const Eigen::VectorXd& u);

/// Largest change of a whitened residual when the integrator works a hundred times finer; where
/// that exceeds the step limit, a hundred times coarser.
[[nodiscard]] double integration_error_sigma(const Problem& problem, const Eigen::VectorXd& u);

struct Criteria {
  double chi2 = 0.0;  ///< with the track's own sigmas, robust weights
  int rows = 0;
  double aicc = 0.0, bic = 0.0;
};
/// AICc and BIC from Uncertainty::minus2_log_likelihood: what residuals that hang together may owe
/// to the tracker does not count as evidence between models.
[[nodiscard]] Criteria criteria(const Problem& problem, const Eigen::VectorXd& u,
                                double minus2_log_likelihood);

}  // namespace trochoid::fitting
