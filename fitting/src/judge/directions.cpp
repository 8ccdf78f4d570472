#include "judge/directions.hpp"

#include <algorithm>

#include "observe/decompositions.hpp"

namespace trochoid::fitting {

Directions directions_of(const Eigen::MatrixXd& scaled) {
  const Eigen::Index count = scaled.cols();
  const Axes axes = right_singular(scaled.rows() > count ? Reflections(scaled).triangle() : scaled);
  Directions seen{axes.directions,
                  Eigen::VectorXd::Zero(count),
                  Eigen::VectorXd::Zero(count),
                  Eigen::MatrixXd::Zero(count, count),
                  {}};
  seen.singular.head(axes.values.size()) = axes.values;
  // 1e-9: below that the derivatives themselves (integrated at ~1e-8) are rounding.
  const double floor = 1e-9 * std::max(seen.singular.maxCoeff(), 1e-300);
  // Standard deviation of what the data do not see at all, in natural sizes: no derivative says how
  // large, and with small residuals 1 / floor would read as a sharp measurement.
  const double unseen = std::max(1.0 / floor, 1e3);
  for (Eigen::Index i = 0; i < count; ++i) {
    const Eigen::VectorXd direction = seen.axes.col(i);
    if (seen.singular[i] > floor)
      seen.inverse[i] = 1.0 / seen.singular[i];
    else
      seen.blind += unseen * unseen * direction * direction.transpose();
  }
  seen.bread = seen.axes * seen.inverse.cwiseAbs2().asDiagonal() * seen.axes.transpose();
  return seen;
}

}  // namespace trochoid::fitting
