#include "valley.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

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

// How the other directions follow a step to both sides. Where one side leads out of a parameter's
// range, as below a loss that is hardly there, or out of the model, the other has to do; empty
// where both do.
std::optional<Eigen::VectorXd> Valley::bend(const Chords& chords,
                                            const Eigen::VectorXd& distances) const {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(all.residuals.size()), there;
  int sides = 0;
  for (const double side : {1.0, -1.0}) {
    if (!displaced(side * values * distances, there)) continue;
    sum += there - all.residuals - side * chords.derivatives * distances;
    ++sides;
  }
  if (sides == 0) return std::nullopt;
  return inverse.asDiagonal() * chords.derivatives.transpose() * sum / sides;
}

// What a bend does to the directions other than those it is seen along, j and k; no more than some
// error bars: where the cost has ripples or the model ends, no parabola holds.
Eigen::VectorXd Valley::sideways(Eigen::VectorXd bend, const Eigen::VectorXd& sd, Eigen::Index j,
                                 Eigen::Index k) const {
  constexpr double kMostBend = 5.0;
  bend[j] = bend[k] = 0.0;
  const double most = kMostBend * std::max(sd[j] / inverse[j], sd[k] / inverse[k]);
  return bend * std::min(1.0, most / std::max(bend.norm(), 1e-300));
}

Eigen::MatrixXd Valley::bends(const Chords& chords, const Eigen::VectorXd& sd) const {
  constexpr std::size_t kPaired = 4;  // directions; of the others' pairs nothing shows
  const Eigen::Index count = sd.size();
  const auto along = [&](Eigen::Index k) { return sd[k] * Eigen::VectorXd::Unit(count, k); };
  Eigen::MatrixXd alone = Eigen::MatrixXd::Zero(count, count), single = alone;
  std::vector<Eigen::Index> directions;
  for (Eigen::Index k = 0; k < count; ++k) {
    if (!(sd[k] > 0.0 && inverse[k] > 0.0 && sd[k] <= kNearlyUnseen)) continue;
    const auto own = bend(chords, along(k));
    if (!own) continue;
    alone.col(k) = *own;
    single.col(k) = sideways(alone.col(k), sd, k, k);
    directions.push_back(k);
  }
  const Eigen::VectorXd sum = single.rowwise().sum();
  Eigen::MatrixXd moment = 2.0 * single * single.transpose() + sum * sum.transpose();
  std::sort(directions.begin(), directions.end(),
            [&](Eigen::Index j, Eigen::Index k) { return sd[j] > sd[k]; });
  directions.resize(std::min(directions.size(), kPaired));
  for (std::size_t i = 0; i < directions.size(); ++i)
    for (std::size_t other = 0; other < i; ++other) {
      const Eigen::Index j = directions[i], k = directions[other];
      auto both = bend(chords, along(j) + along(k));
      if (!both) both = bend(chords, along(j) - along(k));  // bends as much, the other way
      if (!both) continue;
      const Eigen::VectorXd mixed = sideways(*both - alone.col(j) - alone.col(k), sd, j, k);
      moment += mixed * mixed.transpose();
    }
  return moment;
}

}  // namespace trochoid::fitting
