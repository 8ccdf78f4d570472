#include <algorithm>
#include <cmath>
#include <functional>

#include "observe/angles.hpp"
#include "start/strategy.hpp"
#include "trochoid/data/angle.hpp"

namespace trochoid::fitting {
namespace {

// Measured minus predicted spin angle for psi_0 = omega_s = 0, and by how much a spin of one radian
// per second at the start would have turned by then: the time, less where the spin decays.
struct SpinDifference {
  std::vector<double> turn_s, angle_rad;
};

// Columns theta and psi of every sample.
Eigen::VectorXd predicted_angles(const Problem& problem, int arc, const Eigen::VectorXd& values) {
  const ArcData& data = problem.arcs[arc];
  model::PredictRequest request;
  request.t_s = data.t_s;
  request.start_s = data.start_s;
  request.observables = {model::Observable::theta_rad, model::Observable::psi_rad};
  request.tolerance = problem.tolerance;
  request.lies_where_it_fell = true;
  request.rolls_at_first = problem.rolls_at_first;
  return problem.predictor->predict(values, request).values;
}

SpinDifference spin_difference(const Problem& problem, int arc, int psi, int omega) {
  const ArcData& data = problem.arcs[arc];
  Eigen::VectorXd values = problem.base[arc];
  values[psi] = 0.0;
  if (omega >= 0) values[omega] = 0.0;
  const Eigen::VectorXd still = predicted_angles(problem, arc, values);
  if (omega >= 0) values[omega] = 1.0;
  const Eigen::VectorXd turning = omega >= 0 ? predicted_angles(problem, arc, values) : still;
  SpinDifference difference;
  for (const Reading& reading : data.readings) {
    if (reading.channel != Channel::psi) continue;
    const int row = 2 * reading.sample;
    if (!std::isfinite(still[row + 1]) || !std::isfinite(turning[row + 1])) continue;
    double measured = reading.value.x();
    if (data.folded && still[row] > 0.5 * data::kPi) measured = data::kPi - measured;
    difference.angle_rad.push_back(measured - still[row + 1]);
    difference.turn_s.push_back(turning[row + 1] - still[row + 1]);
  }
  return difference;
}

// Slope and value at t = 0 of the line through the angles, continued along their rate.
std::pair<double, double> line_through(const SpinDifference& raw) {
  const std::vector<double>& t = raw.turn_s;
  const std::vector<double> angle = continued_along_rate(t, raw.angle_rad);
  const int n = static_cast<int>(angle.size());
  const Eigen::Map<const Eigen::VectorXd> turn(t.data(), n), along(angle.data(), n);
  const Eigen::VectorXd centred = turn.array() - turn.mean();
  const double slope = centred.dot(along) / centred.squaredNorm();
  return {slope, along.mean() - slope * turn.mean()};
}

}  // namespace

void start_spin(Problem& problem, int arc) {
  const int psi = problem.predictor->index_of("psi_rad");
  const int omega = problem.predictor->index_of("omega_s_rad_s");
  if (psi < 0 || problem.arcs[arc].observable_index(model::Observable::psi_rad) < 0) return;
  const SpinDifference difference = spin_difference(problem, arc, psi, omega);
  if (difference.angle_rad.size() < 3) return;
  // A spin that is gone before the track ends tells nothing of its start.
  if (omega >= 0 && std::adjacent_find(difference.turn_s.begin(), difference.turn_s.end(),
                                       std::greater_equal<>()) != difference.turn_s.end())
    return;
  if (omega >= 0) {
    const auto [slope, offset] = line_through(difference);
    problem.base[arc][omega] = slope;
    problem.base[arc][psi] = offset;
    return;
  }
  double s = 0.0, c = 0.0;
  for (const double angle : difference.angle_rad) s += std::sin(angle), c += std::cos(angle);
  problem.base[arc][psi] = std::atan2(s, c);
}

}  // namespace trochoid::fitting
