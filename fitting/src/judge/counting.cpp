#include "judge/counting.hpp"

#include <Eigen/LU>
#include <algorithm>

namespace trochoid::fitting {

Eigen::VectorXd plain_residuals(const Problem& problem, int arc, const Eigen::VectorXd& u) {
  const Problem plain = in_stated_sigmas(problem, Weights::dropped);
  Eigen::VectorXd residuals;
  return evaluate(plain, arc, u, residuals, nullptr) ? residuals : Eigen::VectorXd();
}

Eigen::MatrixX2d predicted_m(const ArcData& data, const Eigen::VectorXd& residuals) {
  Eigen::MatrixX2d xy = data.positions_m();
  for (const Reading& reading : data.readings)
    if (reading.channel == Channel::position) {
      const Eigen::Matrix2d wt = reading.whitener.transpose();
      xy.row(reading.sample) += (wt.inverse() * residuals.segment<2>(reading.row)).transpose();
    }
  return xy;
}

std::vector<Counting> counting(const Problem& problem, int arc, const Eigen::VectorXd& u) {
  // Of the path: less is what integrating leaves in a simulated track, which has no other noise.
  constexpr double kNothing = 1e-5;
  const ArcData& data = problem.arcs[arc];
  if (data.observable_index(model::Observable::x_m) < 0) return {};
  const Eigen::VectorXd residuals = plain_residuals(problem, arc, u);
  if (residuals.size() == 0) return {};
  const Eigen::MatrixX2d off = predicted_m(data, residuals) - data.positions_m();
  const double nothing_m = kNothing * extent_m(data);
  const std::vector<int> consistent = consistent_samples(data);
  std::vector<Counting> all;
  for (const Reading& reading : data.readings) {
    if (reading.channel != Channel::position) continue;
    const bool glitch = !std::binary_search(consistent.begin(), consistent.end(), reading.sample);
    const bool means_something = off.row(reading.sample).norm() >= nothing_m;
    all.push_back({data.t_s[reading.sample],
                   means_something ? robust_weight(problem, arc, reading) : 1.0, glitch});
  }
  return all;
}

bool is_tracked(const Problem& problem) {
  return std::all_of(problem.arcs.begin(), problem.arcs.end(),
                     [](const ArcData& a) { return a.filmed || a.sigma_unknown; });
}

}  // namespace trochoid::fitting
