#include "judge/degeneracies.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstddef>
#include <set>
#include <string>
#include <vector>

#include "judge/directions.hpp"
#include "judge/statistics.hpp"
#include "observe/timing.hpp"
#include "problem/linearise.hpp"

namespace trochoid::fitting {
namespace {

using Channels = std::vector<Channel>;

bool holds(const Channels& channels, Channel channel) {
  return std::find(channels.begin(), channels.end(), channel) != channels.end();
}

const char* word_for(const Channels& channels) {
  if (channels.size() > 1) return "angles";
  switch (channels.front()) {
    case Channel::theta:
      return "tilt";
    case Channel::phi:
      return "precession";
    default:
      return "spin";
  }
}

// The rows of all other readings, and of priors; none where there are no other readings.
Eigen::MatrixXd without(const Channels& channels, const Linearised& all,
                        const Eigen::MatrixXd& scaled) {
  std::vector<Eigen::Index> rows;
  bool readings = false;
  for (Eigen::Index row = 0; row < scaled.rows(); ++row) {
    const bool prior = all.arc[static_cast<std::size_t>(row)] < 0;
    if (!prior && holds(channels, all.channel[static_cast<std::size_t>(row)])) continue;
    rows.push_back(row);
    readings = readings || !prior;
  }
  if (!readings) rows.clear();
  return scaled(rows, Eigen::all);
}

Channels angles_read(const Linearised& all) {
  Channels angles;
  for (const Channel channel : {Channel::theta, Channel::phi, Channel::psi})
    for (std::size_t row = 0; row < all.channel.size(); ++row)
      if (all.arc[row] >= 0 && all.channel[row] == channel) {
        angles.push_back(channel);
        break;
      }
  return angles;
}

}  // namespace

data::BrokenDegeneracy broken_by(const std::string& readings,
                                 const std::vector<std::string>& names) {
  return {readings, names,
          fmt::format("without the {} seen in the recording, {} would not be known", readings,
                      fmt::join(names, ", "))};
}

std::vector<data::BrokenDegeneracy> broken_degeneracies(const Problem& problem,
                                                        const Eigen::VectorXd& u,
                                                        const data::Fit& fit, bool spin_follows) {
  constexpr double kClearly = 3.0;  // times less certain: else the natural size happens to be near
  const Linearised all = linearise(problem, u);
  const Channels angles = angles_read(all);
  if (angles.empty()) return {};
  const int count = static_cast<int>(problem.free.size());
  Eigen::VectorXd size(count);
  for (int i = 0; i < count; ++i) size[i] = natural_size(problem, i, u);
  const Eigen::MatrixXd scaled = all.jacobian * size.asDiagonal();
  const Eigen::VectorXd with = directions_of(scaled).sd();
  std::vector<Channels> groups;
  for (const Channel one : angles) groups.push_back({one});
  if (angles.size() > 1) groups.push_back(angles);
  std::vector<data::BrokenDegeneracy> broken;
  std::set<std::string> told;
  for (const data::BrokenDegeneracy& known : fit.broken_degeneracies)
    told.insert(known.parameters.begin(), known.parameters.end());
  for (const Channels& group : groups) {
    if (std::any_of(fit.broken_degeneracies.begin(), fit.broken_degeneracies.end(),
                    [&](const auto& known) { return known.readings == word_for(group); }))
      continue;
    const Eigen::MatrixXd others = without(group, all, scaled);
    if (others.rows() == 0) continue;  // a recording of nothing else
    const Eigen::VectorXd rest = directions_of(others).sd();
    std::vector<std::string> names;
    for (int i = 0; i < count; ++i) {
      const std::string& plain = problem.predictor->parameters()[problem.free[i].index].name;
      const bool own =
          plain == "psi_rad" || plain == kAngleDelay || (plain == "omega_s_rad_s" && spin_follows);
      const data::FitParameter* parameter = fit.find(problem.name(i));
      const bool known = parameter != nullptr && parameter->identifiable;
      if (own || !known || rest[i] < std::max(1.0, kClearly * with[i]) ||
          (group.size() > 1 && told.contains(problem.name(i))))
        continue;
      names.push_back(problem.name(i));
      told.insert(names.back());
    }
    if (names.empty()) continue;
    broken.push_back(broken_by(word_for(group), names));
  }
  return broken;
}

}  // namespace trochoid::fitting
