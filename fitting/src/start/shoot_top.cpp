#include <algorithm>
#include <cmath>

#include "observe/smoothing.hpp"
#include "start/strategy.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::fitting {
namespace {

Eigen::MatrixXd places_about_pivot_m(const Problem& problem) {
  const model::Predictor& predictor = *problem.predictor;
  Eigen::MatrixXd xy = problem.arcs[0].positions_m();
  const int px = predictor.index_of("pivot_x_m"), py = predictor.index_of("pivot_y_m");
  if (px >= 0) xy.col(0).array() -= problem.base[0][px];
  if (py >= 0) xy.col(1).array() -= problem.base[0][py];
  return xy;
}

// The state of a top at an instant from the smoothed path: r = l sin(theta), the axis above the
// horizontal, x y' - y x' = r^2 dphi and r r' = l^2 sin(theta) cos(theta) dtheta.
NodeStarter nodes_of(const Problem& problem) {
  const model::Predictor& predictor = *problem.predictor;
  const std::vector<double>& times_s = problem.arcs[0].t_s;
  return [&predictor, t_s = times_s, curve = smooth_auto(times_s, places_about_pivot_m(problem))](
             double t, Eigen::VectorXd& values) {
    const auto place = std::lower_bound(t_s.begin(), t_s.end(), t) - t_s.begin();
    const auto i = std::min<Eigen::Index>(place, curve.value.rows() - 1);
    const double x = curve.value(i, 0), y = curve.value(i, 1);
    const double vx = curve.first(i, 0), vy = curve.first(i, 1);
    const double l = values[predictor.index_of("l_m")];
    const double r = std::hypot(x, y);
    const double s = std::clamp(r / l, 1e-3, 0.98), c = std::sqrt(1.0 - s * s);
    values[predictor.index_of("theta_rad")] = std::asin(s);
    values[predictor.index_of("phi_rad")] = std::atan2(x, -y);
    values[predictor.index_of("dphi_rad_s")] = (x * vy - y * vx) / std::max(r * r, 1e-12 * l * l);
    values[predictor.index_of("dtheta_rad_s")] = (x * vx + y * vy) / (l * l * s * c);
  };
}

// From one start over the first so many nutations, as its b counts them.
Found shoot_over(const Problem& problem, const Problem& started, double over_nutations) {
  constexpr int kFewestSamples = 6;
  Problem own = started;
  const ArcData& arc = problem.arcs[0];
  const double b = std::abs(own.base[0][own.predictor->index_of("b_1_s")]);
  const double nutations = arc.duration_s() * b / data::kTurn;
  const int all = static_cast<int>(arc.t_s.size());
  const double share = std::min(1.0, over_nutations / std::max(nutations, 1e-9));
  const int window = std::clamp(static_cast<int>(share * all), std::min(24, all), all);
  own.arcs[0] = arc.slice(0, window);
  // Shorter than the path reaches out no l can be.
  const double reach = places_about_pivot_m(own).rowwise().norm().maxCoeff();
  double& l = own.base[0][own.predictor->index_of("l_m")];
  l = std::max(l, 1.05 * reach);
  Found best;
  for (const double per_nutation : {5.0, 2.5, 10.0}) {
    const int segments = std::clamp(static_cast<int>(std::lround(per_nutation * share * nutations)),
                                    2, std::max(2, window / kFewestSamples));
    const Found found = multiple_shooting(own, segments, nodes_of(own));
    if (!found.solution.usable) continue;
    Found whole = grow(problem, start_at(own, found.solution.u, "multiple_shooting"), window);
    if (better(whole, best)) best = std::move(whole);
    if (best.passed) break;
  }
  return best;
}

}  // namespace

Found shoot_top(const Problem& problem, const Start& start) {
  if (problem.predictor->index_of("a_1_s2") < 0)
    throw InputError("strategy 'multiple' fits model 'top' only");
  Problem started = problem;
  apply(start, started);
  // Over a few nutations the chain of states is well conditioned; from there single shooting
  // carries on. A start whose b is far off counts them wrongly.
  Found best;
  for (const double nutations : {2.5, 1.5, 4.0}) {
    Found found = shoot_over(problem, started, nutations);
    if (better(found, best)) best = std::move(found);
    if (best.passed) break;
  }
  return best;
}

}  // namespace trochoid::fitting
