#include "problem/valley.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace trochoid::fitting {

// Residuals of a displaced solution; false where a parameter leaves its range or the model ends.
bool Valley::displaced(const Eigen::VectorXd& step, Eigen::VectorXd& residuals) const {
  Eigen::VectorXd at = u;
  for (Eigen::Index i = 0; i < u.size(); ++i) {
    const Transform& transform = problem.free[i].transform;
    const double here = transform.value(u[i]), value = here + step[i];
    at[i] = transform.inverse(value);
    // Beyond a bound the value stops short; that of a light body's couple may be as small as any.
    const double rounding = 1e-12 * std::abs(here);
    if (!(std::abs(transform.value(at[i]) - value) <= 1e-3 * std::abs(step[i]) + rounding))
      return false;
  }
  Eigen::VectorXd there;
  if (!all_residuals(problem, at, there) || !there.allFinite()) return false;
  residuals = all.residuals;
  residuals.head(there.size()) = there;
  return true;
}

// How the other directions follow a step to both sides. Where one side leads out of a parameter's
// range, as below a loss that is hardly there, or out of the model, the other has to do; empty
// where both do.
std::optional<Eigen::VectorXd> Valley::bend(const Eigen::VectorXd& distances) const {
  // Along one or two of many directions.
  Eigen::VectorXd step = Eigen::VectorXd::Zero(values.rows());
  Eigen::VectorXd straight = Eigen::VectorXd::Zero(all.residuals.size());
  for (Eigen::Index k = 0; k < distances.size(); ++k) {
    if (distances[k] == 0.0) continue;
    step += distances[k] * values.col(k);
    straight += distances[k] * tangents.col(k);
  }
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(all.residuals.size()), there;
  int sides = 0;
  for (const double side : {1.0, -1.0}) {
    if (!displaced(side * step, there)) continue;
    sum += there - all.residuals - side * straight;
    ++sides;
  }
  if (sides == 0) return std::nullopt;
  return inverse.asDiagonal() * tangents.transpose() * sum / sides;
}

Eigen::MatrixXd Valley::bends(const Eigen::VectorXd& sd) const {
  constexpr std::size_t kPaired = 4;  // directions; of the others' pairs nothing shows
  const Eigen::Index count = sd.size();
  const auto along = [&](Eigen::Index k) { return sd[k] * Eigen::VectorXd::Unit(count, k); };
  Eigen::MatrixXd alone = Eigen::MatrixXd::Zero(count, count), single = alone;
  std::vector<Eigen::Index> directions;
  for (Eigen::Index k = 0; k < count; ++k) {
    if (!(sd[k] > 0.0 && inverse[k] > 0.0 && sd[k] <= farthest[k])) continue;
    const auto own = bend(along(k));
    if (!own) continue;
    alone.col(k) = *own;
    single.col(k) = *own;
    single(k, k) = 0.0;  // along the direction itself the error bar is that of the residuals
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
      auto both = bend(along(j) + along(k));
      if (!both) both = bend(along(j) - along(k));  // bends as much, the other way
      if (!both) continue;
      Eigen::VectorXd mixed = *both - alone.col(j) - alone.col(k);
      mixed[j] = mixed[k] = 0.0;
      moment += mixed * mixed.transpose();
    }
  return moment;
}

}  // namespace trochoid::fitting
