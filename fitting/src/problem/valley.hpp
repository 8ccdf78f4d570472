#pragma once
#include <Eigen/Core>
#include <optional>

#include "problem/linearise.hpp"

namespace trochoid::fitting {

/// The surroundings of a solution along orthogonal directions of the data.
struct Valley {
  const Problem& problem;
  const Eigen::VectorXd& u;
  const Linearised& all;
  Eigen::MatrixXd tangents;  ///< derivatives of the residuals per unit of each direction
  Eigen::MatrixXd values;    ///< of the parameters per unit of each direction
  Eigen::VectorXd inverse;   ///< standard deviation of independent residuals; 0: unseen
  Eigen::VectorXd farthest;  ///< units along each direction beyond which nothing is looked at

  /// Second moment of how far bends take the solution aside, in the standard deviations of
  /// independent residuals along the directions. When the solution is moved to either side by `sd`
  /// along a direction k, or by those of two at once, the mean of both residual vectors (or the
  /// only one, beside a parameter's limit) leaves the tangent plane and the other directions
  /// follow. With standard normal t they follow by sum_k w_k t_k^2 + sum_j<k w_jk t_j t_k, of which
  /// the second moment is 2 sum w_k w_k^T + (sum w_k)(sum w_k)^T + sum w_jk w_jk^T. Pairs are those
  /// of the least certain directions. Measured over the distances that correlated residuals let
  /// the solution move.
  [[nodiscard]] Eigen::MatrixXd bends(const Eigen::VectorXd& sd) const;

 private:
  [[nodiscard]] std::optional<Eigen::VectorXd> bend(const Eigen::VectorXd& distances) const;
  [[nodiscard]] bool displaced(const Eigen::VectorXd& step, Eigen::VectorXd& residuals) const;
};

}  // namespace trochoid::fitting
