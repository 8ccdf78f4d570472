#pragma once
#include <Eigen/Core>
#include <optional>

#include "linearise.hpp"

namespace trochoid::fitting {

/// What moving along a direction really does to the residuals, over an error bar.
struct Chords {
  Eigen::MatrixXd derivatives;  ///< per unit of each direction
  bool straight = true;         ///< the derivatives at the solution say the same
};

/// The surroundings of a solution along orthogonal directions of the data.
struct Valley {
  const Problem& problem;
  const Eigen::VectorXd& u;
  const Linearised& all;
  Eigen::MatrixXd tangents;  ///< derivatives of the residuals per unit of each direction
  Eigen::MatrixXd values;    ///< of the parameters per unit of each direction
  Eigen::VectorXd inverse;   ///< standard deviation of independent residuals; 0: unseen

  /// Chords where the data see enough of a direction and the model goes on to both ends, tangents
  /// elsewhere.
  [[nodiscard]] Chords chords() const;

  /// Second moment of how far bends take the solution aside, in the standard deviations of
  /// independent residuals along the directions. When the solution is moved to either side by `sd`
  /// along a direction k, or by those of two at once, the mean of both residual vectors (or the
  /// only one, beside a parameter's limit) leaves the tangent plane and the other directions
  /// follow. With standard normal t they follow by sum_k w_k t_k^2 + sum_j<k w_jk t_j t_k, of which
  /// the second moment is 2 sum w_k w_k^T + (sum w_k)(sum w_k)^T + sum w_jk w_jk^T. Pairs are those
  /// of the least certain directions. Measured over the distances that correlated residuals let
  /// the solution move: ripples do not grow with the square of those.
  [[nodiscard]] Eigen::MatrixXd bends(const Chords& chords, const Eigen::VectorXd& sd) const;

 private:
  [[nodiscard]] std::optional<Eigen::VectorXd> bend(const Chords& chords,
                                                    const Eigen::VectorXd& distances) const;
  [[nodiscard]] Eigen::VectorXd sideways(Eigen::VectorXd bend, const Eigen::VectorXd& sd,
                                         Eigen::Index j, Eigen::Index k) const;
  [[nodiscard]] bool displaced(const Eigen::VectorXd& step, Eigen::VectorXd& residuals) const;
  [[nodiscard]] bool both_sides(Eigen::Index k, double distance, Eigen::VectorXd& ahead,
                                Eigen::VectorXd& behind) const;
};

}  // namespace trochoid::fitting
