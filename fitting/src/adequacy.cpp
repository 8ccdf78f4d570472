#include "adequacy.hpp"

#include <fmt/core.h>

#include <cmath>

#include "smoothing.hpp"

namespace trochoid::fitting {

Squares squares(const Problem& problem, const Solution& solution) {
  Squares sum;
  for (int arc = 0; arc < static_cast<int>(problem.arcs.size()); ++arc) {
    const ArcData& data = problem.arcs[arc];
    if (data.observable_index(model::Observable::x_m) < 0) continue;
    Problem plain = problem;
    plain.noise_scale.fill(1.0);
    Eigen::VectorXd r;
    if (!evaluate(plain, arc, solution.u, r, nullptr)) return {.ok = false};
    const Eigen::MatrixX2d xy = data.positions_m();
    const Eigen::RowVector2d mean = xy.colwise().mean();
    const double noise_m = noise_about_smooth_curve(data.t_s, xy);
    for (const Reading& reading : data.readings) {
      if (reading.channel != Channel::position) continue;
      const Eigen::Matrix2d wt = reading.whitener.transpose();
      sum.residual += r.segment<2>(reading.row).squaredNorm();
      sum.motion += (wt * (reading.value - mean.transpose())).squaredNorm();
      sum.scatter += wt.squaredNorm() * noise_m * noise_m;
    }
  }
  return sum;
}

// A quiet minimiser in the wrong valley: the residuals carry a good part of the motion although the
// samples scatter far less about a smooth curve.
bool explains_path(const Squares& sum) {
  return sum.ok && (sum.residual <= 0.03 * sum.motion || sum.residual <= 4.0 * sum.scatter);
}

void warn_unexplained(const Squares& sum, data::Fit& fit) {
  // Twice the scatter: more than a smoothing curve misjudges the noise.
  if (!sum.ok || sum.residual <= 4.0 * sum.scatter) return;
  fit.warnings.push_back(
      fmt::format("the residuals are {:.1f} times the scatter of the samples about a smooth curve: "
                  "the model lacks something, or a better minimum exists",
                  std::sqrt(sum.residual / sum.scatter)));
}

}  // namespace trochoid::fitting
