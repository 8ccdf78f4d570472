#include "valley.hpp"

#include <cmath>

namespace trochoid::fitting {
namespace {

constexpr double kNearlyUnseen = 1.0;  // of a natural size: no small step

}  // namespace

// Residuals of a displaced solution; false where a parameter leaves its range or the model ends.
bool Valley::displaced(const Eigen::VectorXd& step, Eigen::VectorXd& residuals) const {
  Eigen::VectorXd at = u;
  for (Eigen::Index i = 0; i < u.size(); ++i) {
    const Transform& transform = problem.free[i].transform;
    const double value = transform.value(u[i]) + step[i];
    at[i] = transform.inverse(value);
    if (!(std::abs(transform.value(at[i]) - value) <= 1e-3 * std::abs(step[i]) + 1e-12))
      return false;
  }
  Eigen::VectorXd there;
  if (!all_residuals(problem, at, there) || !there.allFinite()) return false;
  residuals = all.residuals;
  residuals.head(there.size()) = there;
  return true;
}

bool Valley::both_sides(Eigen::Index k, double distance, Eigen::VectorXd& ahead,
                        Eigen::VectorXd& behind) const {
  const Eigen::VectorXd step = distance * values.col(k);
  return displaced(step, ahead) && displaced(-step, behind);
}

Chords Valley::chords() const {
  constexpr double kStraight = 0.2;
  Chords chords{tangents, true};
  for (Eigen::Index k = 0; k < inverse.size(); ++k) {
    if (!(inverse[k] > 0.0) || inverse[k] > kNearlyUnseen) continue;
    Eigen::VectorXd ahead, behind;
    if (!both_sides(k, inverse[k], ahead, behind)) continue;
    // Turning angles jump by whole turns of residual; priors are linear.
    Eigen::VectorXd slope = 0.5 * (ahead - behind);
    const Eigen::Index priors = slope.size() - problem.rows();
    const Eigen::VectorXd tangent = inverse[k] * tangents.col(k);
    slope.tail(priors) = tangent.tail(priors);
    if ((slope - tangent).norm() < kStraight) continue;
    chords.straight = false;
    chords.derivatives.col(k) = slope / inverse[k];
  }
  return chords;
}

Eigen::MatrixXd Valley::bends(const Chords& chords, const Eigen::VectorXd& sd) const {
  Eigen::MatrixXd bend = Eigen::MatrixXd::Zero(chords.derivatives.rows(), sd.size());
  for (Eigen::Index k = 0; k < sd.size(); ++k) {
    if (!(sd[k] > 0.0) || sd[k] > kNearlyUnseen) continue;
    Eigen::VectorXd ahead, behind;
    if (both_sides(k, sd[k], ahead, behind)) bend.col(k) = 0.5 * (ahead + behind) - all.residuals;
  }
  Eigen::MatrixXd w = inverse.asDiagonal() * chords.derivatives.transpose() * bend;
  w.diagonal().setZero();
  return w;
}

}  // namespace trochoid::fitting
