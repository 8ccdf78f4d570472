#include <cmath>
#include <deque>
#include <numbers>

#include "smoothing.hpp"
#include "strategy.hpp"

namespace trochoid::fitting {
namespace {

// Measured minus predicted spin angle for psi_0 = omega_s = 0, with the times since the start.
struct SpinDifference {
  std::vector<double> t_s, angle_rad;
};

SpinDifference spin_difference(const Problem& problem, int arc, int psi, int omega) {
  const ArcData& data = problem.arcs[arc];
  Eigen::VectorXd values = problem.base[arc];
  values[psi] = 0.0;
  if (omega >= 0) values[omega] = 0.0;
  model::PredictRequest request;
  request.t_s = data.t_s;
  request.start_s = data.start_s;
  request.observables = {model::Observable::theta_rad, model::Observable::psi_rad};
  const model::Prediction prediction = problem.predictor->predict(values, request);
  SpinDifference difference;
  for (const Reading& reading : data.readings) {
    if (reading.channel != Channel::psi) continue;
    double measured = reading.value.x();
    if (data.folded && prediction.values[2 * reading.sample] > 0.5 * std::numbers::pi)
      measured = std::numbers::pi - measured;
    difference.angle_rad.push_back(measured - prediction.values[2 * reading.sample + 1]);
    difference.t_s.push_back(data.t_s[reading.sample] - data.start_s);
  }
  return difference;
}

// Continues the angles along their own rate: the next value lies where the latest rates take it,
// not merely within half a turn. Returns slope and value at t = 0 of the line through them.
std::pair<double, double> line_through(const SpinDifference& raw) {
  constexpr std::size_t kLatest = 31;
  std::vector<double> angle;
  std::deque<double> rates;
  for (std::size_t i = 0; i < raw.t_s.size(); ++i) {
    double d = raw.angle_rad[i];
    if (i > 0) {
      const double step_s = raw.t_s[i] - raw.t_s[i - 1];
      const double expected =
          angle.back() + (rates.empty() ? 0.0 : median({rates.begin(), rates.end()}) * step_s);
      d = expected + std::remainder(d - expected, 2.0 * std::numbers::pi);
      rates.push_back((d - angle.back()) / step_s);
      if (rates.size() > kLatest) rates.pop_front();
    }
    angle.push_back(d);
  }
  const int n = static_cast<int>(angle.size());
  const Eigen::Map<const Eigen::VectorXd> t(raw.t_s.data(), n), d(angle.data(), n);
  const Eigen::VectorXd centred = t.array() - t.mean();
  const double slope = centred.dot(d) / centred.squaredNorm();
  return {slope, d.mean() - slope * t.mean()};
}

}  // namespace

void start_spin(Problem& problem, int arc) {
  const int psi = problem.predictor->index_of("psi_rad");
  const int omega = problem.predictor->index_of("omega_s_rad_s");
  if (psi < 0 || problem.arcs[arc].observable_index(model::Observable::psi_rad) < 0) return;
  const SpinDifference difference = spin_difference(problem, arc, psi, omega);
  if (difference.t_s.size() < 3) return;
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
