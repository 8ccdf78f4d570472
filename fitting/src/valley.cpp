#include "valley.hpp"

#include <algorithm>
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

// Where one side leads out of a parameter's range, as below a loss that is hardly there, or out of
// the model, the other has to do.
Eigen::VectorXd Valley::bend(Eigen::Index k, double distance,
                             const Eigen::VectorXd& derivatives) const {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(all.residuals.size()), there;
  int sides = 0;
  for (const double step : {distance, -distance}) {
    if (!displaced(step * values.col(k), there)) continue;
    sum += there - all.residuals - step * derivatives;
    ++sides;
  }
  return sum / std::max(1, sides);
}

Eigen::MatrixXd Valley::bends(const Chords& chords, const Eigen::VectorXd& sd) const {
  Eigen::MatrixXd bent = Eigen::MatrixXd::Zero(chords.derivatives.rows(), sd.size());
  for (Eigen::Index k = 0; k < sd.size(); ++k)
    if (sd[k] > 0.0 && sd[k] <= kNearlyUnseen)
      bent.col(k) = bend(k, sd[k], chords.derivatives.col(k));
  Eigen::MatrixXd w = inverse.asDiagonal() * chords.derivatives.transpose() * bent;
  w.diagonal().setZero();
  return w;
}

}  // namespace trochoid::fitting
