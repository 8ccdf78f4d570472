#include "judge/steady_top.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "observe/angles.hpp"
#include "observe/decompositions.hpp"

namespace trochoid::fitting {
namespace {

// A path about the pivot without nutation: distance and azimuth as polynomials in time since the
// start, constant and linear without drag; with drag the axis sinks or rises and the rate drifts.
struct Circle {
  Eigen::VectorXd distance_m, azimuth_rad;
};

double at(const Eigen::VectorXd& coefficients, double t) {
  double value = 0.0;
  for (Eigen::Index k = coefficients.size() - 1; k >= 0; --k) value = value * t + coefficients[k];
  return value;
}

Circle circle_through(const ArcData& arc, const Eigen::Vector2d& pivot_m, bool drag) {
  const Eigen::MatrixX2d xy = arc.positions_m().rowwise() - pivot_m.transpose();
  const Eigen::Index n = xy.rows();
  const int highest = drag ? 3 : 1;
  const Eigen::VectorXd azimuth = precessions(xy);
  Eigen::MatrixXd powers(n, highest + 1);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double t = arc.t_s[static_cast<std::size_t>(i)] - arc.start_s;
    for (int k = 0; k <= highest; ++k) powers(i, k) = std::pow(t, k);
  }
  return {LeastSquares(powers.leftCols(highest)).solve(xy.rowwise().norm()),
          LeastSquares(powers).solve(azimuth)};
}

double chi2_of(const Problem& problem, const Circle& circle, const Eigen::Vector2d& pivot_m) {
  const ArcData& arc = problem.arcs[0];
  double chi2 = 0.0;
  for (const Reading& reading : arc.readings) {
    if (reading.channel != Channel::position) continue;
    const double t = arc.t_s[static_cast<std::size_t>(reading.sample)] - arc.start_s;
    const double phi = at(circle.azimuth_rad, t);
    const Eigen::Vector2d place =
        pivot_m + at(circle.distance_m, t) * Eigen::Vector2d(std::sin(phi), -std::cos(phi));
    const double weight = robust_weight(problem, 0, reading) / problem.noise_scale[0];
    chi2 += (weight * (reading.whitener.transpose() * (place - reading.value))).squaredNorm();
  }
  return chi2;
}

}  // namespace

void admit_steady_precession(const Problem& problem, const Eigen::VectorXd& u, data::Fit& fit) {
  using model::Observable;
  if (problem.arcs.size() != 1) return;
  const bool drag = std::any_of(fit.parameters.begin(), fit.parameters.end(),
                                [](const auto& one) { return one.name.starts_with("gamma"); });
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
  const Circle circle = circle_through(arc, pivot_m, drag);
  // Four more parameters lower chi-square by 4 +- 2.8 when they mean nothing, 3 sigma; and of as
  // many frequencies as there are samples nutation may take that of the noise's strongest line.
  const double bought_by_chance = 4.0 + 3.0 * 2.83 + 2.0 * std::log(arc.t_s.size());
  if (chi2_of(problem, circle, pivot_m) - residuals.squaredNorm() > bought_by_chance) return;
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
      circle.distance_m[0], circle.azimuth_rad[1]));
}

}  // namespace trochoid::fitting
