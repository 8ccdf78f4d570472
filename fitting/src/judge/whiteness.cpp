#include "judge/whiteness.hpp"

#include <algorithm>
#include <cmath>

#include "observe/decompositions.hpp"

namespace trochoid::fitting {

double chi2_upper_tail(double chi2, double dof) {
  if (!(chi2 > 0.0) || !(dof > 0.0)) return 1.0;
  const double spread = 2.0 / (9.0 * dof);
  const double z = (std::cbrt(chi2 / dof) - (1.0 - spread)) / std::sqrt(spread);
  return 0.5 * std::erfc(z / std::sqrt(2.0));
}

namespace {

using Rows = std::vector<int>;

// Rows of one channel of one arc in time order, coordinate by coordinate.
std::vector<Rows> rows_by_coordinate(const Linearised& all, Channel channel, int arc) {
  const int width = rows_of(channel);
  std::vector<Rows> coordinates(static_cast<std::size_t>(width));
  int count = 0;
  for (int row = 0; row < static_cast<int>(all.arc.size()); ++row)
    if (all.arc[row] == arc && all.channel[row] == channel)
      coordinates[static_cast<std::size_t>(count++ % width)].push_back(row);
  return coordinates;
}

// Orthonormal columns: the directions of the rows that the parameters follow mainly because of
// these rows, not of others.
Eigen::MatrixXd taken_from(const Eigen::MatrixXd& scaled, const Eigen::MatrixXd& unit_steps,
                           const Rows& rows, const std::vector<int>& columns) {
  constexpr double kMainly = 0.5;  // of what is known of the direction
  const Eigen::MatrixXd part = scaled(rows, columns);
  const Reflections reflections(part);
  const Eigen::Index rank = std::min(part.rows(), part.cols());
  const Axes axes = left_singular(reflections.triangle() * unit_steps(columns, Eigen::all));
  const Eigen::Index kept = (axes.values.array().square() > kMainly).count();
  Eigen::MatrixXd directions = Eigen::MatrixXd::Zero(part.rows(), kept);
  directions.topRows(rank) = axes.directions.leftCols(kept);
  return reflections.turned(directions);
}

NoiseGroup group_of(const Problem& problem, const Linearised& all, Channel channel, int arc,
                    const Eigen::MatrixXd& scaled, const Eigen::MatrixXd& unit_steps) {
  const std::vector<Rows> coordinates = rows_by_coordinate(all, channel, arc);
  Rows together;
  for (const Rows& rows : coordinates) together.insert(together.end(), rows.begin(), rows.end());
  if (together.empty()) return {};
  const Eigen::MatrixXd taken = taken_from(scaled, unit_steps, together, problem.columns_of(arc));
  NoiseGroup group;
  Eigen::Index first = 0;
  for (const Rows& rows : coordinates) {
    const auto n = static_cast<Eigen::Index>(rows.size());
    group.push_back({all.residuals(rows), taken.middleRows(first, n)});
    first += n;
  }
  return group;
}

// Autocorrelations of several series about zero, tested for being none (Ljung and Box, Biometrika
// 65, 297, 1978).
class Correlations {
 public:
  void add(const std::vector<Eigen::VectorXd>& coordinates) {
    constexpr Eigen::Index kFewest = 20, kMostLags = 20;
    const Eigen::Index n = coordinates.front().size();
    double power = 0.0;
    for (const Eigen::VectorXd& one : coordinates) power += one.squaredNorm();
    if (n < kFewest || !(power > 0.0)) return;
    const Eigen::Index lags = std::min(kMostLags, n / 5);
    const double columns = static_cast<double>(coordinates.size()),
                 samples = static_cast<double>(n);
    for (Eigen::Index lag = 1; lag <= lags; ++lag) {
      double product = 0.0;
      for (const Eigen::VectorXd& one : coordinates)
        product += one.head(n - lag).dot(one.tail(n - lag));
      const double rho = product / power;
      statistic_ += rho * rho * columns * samples * (samples + 2.0) / static_cast<double>(n - lag);
      if (static_cast<Eigen::Index>(products_.size()) < lag) products_.push_back(0.0);
      products_[static_cast<std::size_t>(lag - 1)] += product;
    }
    tested_ += static_cast<double>(lags);
    rows_ += columns * samples;
    power_ += power;
  }
  [[nodiscard]] double p_value() const { return chi2_upper_tail(statistic_, tested_); }
  // Variance of what a column of weights picks up of such residuals, over that of white ones.
  [[nodiscard]] double times_wider(const std::vector<Eigen::MatrixXd>& weights,
                                   Eigen::Index column) const {
    double size = 0.0, sum = 0.0;
    for (const Eigen::MatrixXd& one : weights) {
      const auto w = one.col(column);
      size += w.squaredNorm();
      for (std::size_t i = 0; i < products_.size(); ++i) {
        const auto lag = static_cast<Eigen::Index>(i) + 1;
        const double rho = products_[i] / power_;
        if (lag < w.size() && std::abs(rho) > 2.0 / std::sqrt(rows_))
          sum += rho * w.head(w.size() - lag).dot(w.tail(w.size() - lag));
      }
    }
    return size > 0.0 ? 1.0 + 2.0 * sum / size : 1.0;
  }

 private:
  std::vector<double> products_;
  double statistic_ = 0.0, tested_ = 0.0, rows_ = 0.0, power_ = 0.0;
};

// A group with the likeliest correlation taken out, and from the residuals what the parameters
// then follow.
struct Leftover {
  std::vector<Eigen::VectorXd> residuals;
  std::vector<Eigen::MatrixXd> taken;
};

Leftover leftover(const NoiseKind& kind, const NoiseGroup& group) {
  Leftover left;
  const Eigen::Index taken = group.front().taken.cols();
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(taken, taken);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(taken);
  for (const NoiseSeries& one : group) {
    left.residuals.push_back(decorrelated(kind, one.residual));
    left.taken.push_back(decorrelated(kind, one.taken));
    normal += left.taken.back().transpose() * left.taken.back();
    right += left.taken.back().transpose() * left.residuals.back();
  }
  if (taken == 0) return left;
  const Eigen::VectorXd share = SymmetricEquations(normal).solve(right);
  for (std::size_t i = 0; i < left.taken.size(); ++i) left.residuals[i] -= left.taken[i] * share;
  return left;
}

// What still hangs together then widens the parameter that suffers most.
double excess_of(const NoiseKind& kind, const std::vector<NoiseGroup>& groups) {
  constexpr double kStructured = 1e-3;  // p-value
  Correlations rest;
  std::vector<Leftover> all;
  for (const NoiseGroup& group : groups) {
    all.push_back(leftover(kind, group));
    rest.add(all.back().residuals);
  }
  if (rest.p_value() > kStructured) return 1.0;
  double most = 1.0;
  for (const Leftover& one : all)
    for (Eigen::Index c = 0; c < one.taken.front().cols(); ++c)
      most = std::max(most, rest.times_wider(one.taken, c));
  return most;
}

// Normal equations of the first or the second half of a group's series.
struct Normal {
  Eigen::MatrixXd matrix;
  Eigen::VectorXd right;
  Normal(const Leftover& left, bool late)
      : matrix(Eigen::MatrixXd::Zero(left.taken[0].cols(), left.taken[0].cols())),
        right(Eigen::VectorXd::Zero(left.taken[0].cols())) {
    for (std::size_t i = 0; i < left.taken.size(); ++i) {
      const Eigen::Index n = left.residuals[i].size(), half = n / 2;
      const auto w = left.taken[i].middleRows(late ? half : 0, late ? n - half : half);
      matrix += w.transpose() * w;
      right += w.transpose() * left.residuals[i].segment(late ? half : 0, late ? n - half : half);
    }
  }
  // What chi-square loses by the best change of the parameters, and by how many of them.
  [[nodiscard]] std::pair<double, int> gain() const {
    const Axes axes = principal_axes(matrix);
    const double least = 1e-9 * axes.values.maxCoeff();
    std::pair<double, int> sum;
    for (Eigen::Index i = 0; i < right.size(); ++i) {
      if (!(axes.values[i] > least)) continue;
      const double along = axes.directions.col(i).dot(right);
      sum.first += along * along / axes.values[i];
      ++sum.second;
    }
    return sum;
  }
};

// The likeliest correlation is taken out first.
Drift drift_of(const NoiseKind& kind, const std::vector<NoiseGroup>& groups) {
  double gained = 0.0, squares = 0.0, rows = 0.0, parameters = 0.0;
  for (const NoiseGroup& group : groups) {
    if (group.front().taken.cols() == 0) continue;
    const Leftover left = leftover(kind, group);
    const auto early = Normal(left, false).gain(), late = Normal(left, true).gain();
    gained += early.first + late.first;
    parameters += early.second + late.second - static_cast<double>(left.taken[0].cols());
    for (const Eigen::VectorXd& residual : left.residuals) {
      squares += residual.squaredNorm();
      rows += static_cast<double>(residual.size());
    }
  }
  if (!(parameters > 0.0) || !(squares > gained) || rows <= 2.0 * parameters) return {};
  return {gained / parameters * (rows - 2.0 * parameters) / (squares - gained), parameters};
}

double step_s(const Problem& problem) {
  double duration_s = 0.0, steps = 0.0;
  for (const ArcData& arc : problem.arcs) {
    duration_s += arc.duration_s();
    steps += static_cast<double>(arc.t_s.size()) - 1.0;
  }
  return duration_s / std::max(1.0, steps);
}

}  // namespace

ChannelNoise channel_noise(const Problem& problem, const Linearised& all, Channel channel,
                           const Eigen::MatrixXd& scaled, const Eigen::MatrixXd& unit_steps) {
  constexpr double kCorrelated = 0.5;  // posterior of white noise
  std::vector<NoiseGroup> groups;
  Correlations plain;
  for (int arc = 0; arc < static_cast<int>(problem.arcs.size()); ++arc) {
    NoiseGroup group = group_of(problem, all, channel, arc, scaled, unit_steps);
    if (group.empty()) continue;
    std::vector<Eigen::VectorXd> residuals;
    for (const NoiseSeries& one : group) residuals.push_back(one.residual);
    plain.add(residuals);
    groups.push_back(std::move(group));
  }
  const NoiseEvidence evidence = noise_evidence(groups);
  ChannelNoise noise;
  noise.channel = channel;
  noise.kinds = evidence.kinds;
  noise.minus2_log_likelihood = evidence.minus2_log_likelihood;
  noise.whiteness.p_value = plain.p_value();
  double white = 0.0, inflation = 0.0;
  for (const NoiseKind& kind : noise.kinds) {
    white += kind.share == 0.0 ? kind.posterior : 0.0;
    inflation += kind.posterior * kind.inflation();
  }
  const NoiseKind likeliest = *std::max_element(
      noise.kinds.begin(), noise.kinds.end(),
      [](const NoiseKind& a, const NoiseKind& b) { return a.posterior < b.posterior; });
  noise.excess = excess_of(likeliest, groups);
  noise.drift = drift_of(likeliest, groups);
  if (white > kCorrelated && noise.excess == 1.0) {
    noise.kinds = {NoiseKind{}};
    return noise;
  }
  noise.whiteness.inflation = inflation * noise.excess;
  noise.whiteness.correlation_time_s = 0.5 * (noise.whiteness.inflation - 1.0) * step_s(problem);
  return noise;
}

Eigen::MatrixXd seen_through(const Problem& problem, const Linearised& all,
                             const ChannelNoise& noise, const Eigen::MatrixXd& scaled) {
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(scaled.cols(), scaled.cols());
  for (int arc = 0; arc < static_cast<int>(problem.arcs.size()); ++arc) {
    const std::vector<int> columns = problem.columns_of(arc);
    for (const Rows& rows : rows_by_coordinate(all, noise.channel, arc)) {
      const Eigen::MatrixXd part = scaled(rows, columns);
      for (const NoiseKind& kind : noise.kinds)
        sum(columns, columns) +=
            noise.excess * kind.posterior * kind.variance * seen_through(kind, part);
    }
  }
  return sum;
}

}  // namespace trochoid::fitting
