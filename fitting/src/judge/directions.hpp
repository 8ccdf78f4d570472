#pragma once
#include <Eigen/Core>

namespace trochoid::fitting {

/// The directions of parameter space, and how sharply independent residuals see each.
struct Directions {
  Eigen::MatrixXd axes;      ///< one per column, sharpest first
  Eigen::VectorXd singular;  ///< singular values of the derivatives along each
  Eigen::VectorXd inverse;   ///< standard deviation along each; 0: unseen
  Eigen::MatrixXd blind;     ///< covariance of the unseen ones
  Eigen::MatrixXd bread;     ///< covariance of the seen ones

  /// Standard deviations of the parameters.
  [[nodiscard]] Eigen::VectorXd sd() const {
    return (bread + blind).diagonal().cwiseMax(0.0).cwiseSqrt();
  }
};

/// @param scaled  derivatives of residuals, in units of their noise, by parameters in natural sizes
///                (natural_size); in which all of the result is.
[[nodiscard]] Directions directions_of(const Eigen::MatrixXd& scaled);

}  // namespace trochoid::fitting
