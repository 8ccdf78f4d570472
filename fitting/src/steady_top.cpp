#include "steady_top.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>

namespace trochoid::fitting {
namespace {

struct Circle {
  double radius_m = 0.0, azimuth_rad = 0.0, rate_rad_s = 0.0;
};

// Mean distance from the pivot and the line through the continued azimuth.
Circle circle_through(const ArcData& arc, const Eigen::Vector2d& pivot_m) {
  const Eigen::MatrixX2d xy = arc.positions_m().rowwise() - pivot_m.transpose();
  const Eigen::Index n = xy.rows();
  Eigen::VectorXd azimuth(n), t(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    azimuth[i] = std::atan2(xy(i, 0), -xy(i, 1));
    if (i > 0)
      azimuth[i] =
          azimuth[i - 1] + std::remainder(azimuth[i] - azimuth[i - 1], 2.0 * std::numbers::pi);
    t[i] = arc.t_s[static_cast<std::size_t>(i)] - arc.start_s;
  }
  const Eigen::VectorXd centred = t.array() - t.mean();
  Circle circle;
  circle.radius_m = xy.rowwise().norm().mean();
  circle.rate_rad_s = centred.dot(azimuth) / centred.squaredNorm();
  circle.azimuth_rad = azimuth.mean() - circle.rate_rad_s * t.mean();
  return circle;
}

double chi2_of(const Problem& problem, const Circle& circle, const Eigen::Vector2d& pivot_m) {
  const ArcData& arc = problem.arcs[0];
  double chi2 = 0.0;
  for (const Reading& reading : arc.readings) {
    if (reading.channel != Channel::position) continue;
    const double phi =
        circle.azimuth_rad +
        circle.rate_rad_s * (arc.t_s[static_cast<std::size_t>(reading.sample)] - arc.start_s);
    const Eigen::Vector2d at =
        pivot_m + circle.radius_m * Eigen::Vector2d(std::sin(phi), -std::cos(phi));
    double weight = 1.0 / problem.noise_scale[0];
    if (problem.row_weights[0].size() > 0) weight *= problem.row_weights[0][reading.row];
    chi2 += (weight * (reading.whitener.transpose() * (at - reading.value))).squaredNorm();
  }
  return chi2;
}

}  // namespace

void admit_steady_precession(const Problem& problem, const Eigen::VectorXd& u, data::Fit& fit) {
  using model::Observable;
  if (problem.arcs.size() != 1 || fit.find("gamma1_1_s") != nullptr) return;
  const ArcData& arc = problem.arcs[0];
  if (arc.observable_index(Observable::x_m) < 0 || arc.observable_index(Observable::theta_rad) >= 0)
    return;
  const Eigen::VectorXd values = problem.values(0, u);
  const int px = problem.predictor->index_of("pivot_x_m");
  const int py = problem.predictor->index_of("pivot_y_m");
  const Eigen::Vector2d pivot_m(px >= 0 ? values[px] : 0.0, py >= 0 ? values[py] : 0.0);
  Problem path = problem;
  path.arcs[0] = arc.without(Channel::psi);
  if (path.row_weights[0].size() > 0 && path.arcs[0].rows != arc.rows) return;
  Eigen::VectorXd residuals;
  if (!evaluate(path, 0, u, residuals, nullptr)) return;
  const Circle circle = circle_through(arc, pivot_m);
  // Four more parameters lower chi-square by 4 +- 2.8 when they mean nothing; 3 sigma.
  constexpr double kBoughtByChance = 4.0 + 3.0 * 2.83;
  if (chi2_of(problem, circle, pivot_m) - residuals.squaredNorm() > kBoughtByChance) return;
  constexpr const char* kHidden[] = {"a_1_s2", "b_1_s", "l_m", "theta_rad"};
  for (data::FitParameter& parameter : fit.parameters) {
    const bool hidden = std::any_of(std::begin(kHidden), std::end(kHidden),
                                    [&](const char* name) { return parameter.name == name; });
    if (!hidden && parameter.status != data::ParameterStatus::derived) continue;
    parameter.identifiable = false;
    parameter.sigma = std::numeric_limits<double>::infinity();
    parameter.note += "; no nutation is seen";
  }
  fit.warnings.push_back(fmt::format(
      "no nutation is seen: steady precession determines l sin(theta) = {:.6g} m, the rate W = "
      "{:.6g} rad/s, and a + W^2 cos(theta) = b W; not a, b and l",
      circle.radius_m, circle.rate_rad_s));
}

}  // namespace trochoid::fitting
