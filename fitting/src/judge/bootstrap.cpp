#include "judge/bootstrap.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "observe/angles.hpp"
#include "trochoid/data/parallel.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::fitting {
namespace {

// The readings of one channel of one arc in time order, and how many follow each other in a block.
struct SeriesOfReadings {
  std::vector<int> readings;
  int block = 1;
};

std::vector<SeriesOfReadings> series_of(const ArcData& arc, double correlation_time_s) {
  std::vector<SeriesOfReadings> all;
  for (int c = 0; c < kChannels; ++c) {
    SeriesOfReadings series;
    for (int i = 0; i < static_cast<int>(arc.readings.size()); ++i)
      if (arc.readings[i].channel == static_cast<Channel>(c)) series.readings.push_back(i);
    const auto n = static_cast<double>(series.readings.size());
    if (n < 4.0) continue;
    const double step_s = std::max(arc.duration_s() / n, 1e-300);
    const double block = std::max(std::cbrt(n), 6.0 * correlation_time_s / step_s);
    series.block = std::clamp(static_cast<int>(std::lround(block)), 1, static_cast<int>(n / 4.0));
    all.push_back(std::move(series));
  }
  return all;
}

// The arc with every reading moved so that its residual becomes one drawn from the same series.
void resample(ArcData& arc, const std::vector<SeriesOfReadings>& all,
              const Eigen::VectorXd& residuals, double stretch, std::mt19937_64& generator) {
  for (const SeriesOfReadings& series : all) {
    const int n = static_cast<int>(series.readings.size());
    int source = 0;
    for (int i = 0; i < n; ++i) {
      source = i % series.block == 0 ? std::uniform_int_distribution<int>(0, n - 1)(generator)
                                     : (source + 1) % n;
      Reading& reading = arc.readings[series.readings[i]];
      const Reading& drawn = arc.readings[series.readings[source]];
      const int rows = rows_of(reading.channel);
      // r = W^T (prediction - value): the value moves by W^-T (r - r drawn).
      const Eigen::VectorXd move =
          residuals.segment(reading.row, rows) - stretch * residuals.segment(drawn.row, rows);
      if (rows == 2)
        reading.value += reading.whitener.transpose().inverse() * move.head<2>();
      else
        reading.value.x() += move[0] / reading.whitener(0, 0);
    }
  }
}

data::BootstrapSpread spread_of(const std::string& name, std::vector<double> values) {
  double mean = 0.0, squares = 0.0;
  const auto n = static_cast<double>(values.size());
  for (const double value : values) mean += value / n;
  for (const double value : values) squares += (value - mean) * (value - mean);
  return {name, std::sqrt(squares / std::max(1.0, n - 1.0)), data::quantile(values, 0.025),
          data::quantile(values, 0.975)};
}

// One draw: the values of the free parameters, angles next to the solution's; empty if it failed.
std::vector<double> fit_again(Problem problem, const Solution& solution) {
  Solution again = solve(problem, solution.u);
  if (!again.usable) return {};
  if (reweight(problem, again.u, false) > 1e-3) again = solve(problem, again.u);
  if (!again.usable) return {};
  std::vector<double> values;
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i) {
    double value = problem.value(i, again.u);
    if (problem.predictor->parameters()[problem.free[i].index].unit == "rad")
      value = continued(value, problem.value(i, solution.u));
    values.push_back(value);
  }
  return values;
}

}  // namespace

data::Bootstrap bootstrap(const Problem& problem, const Solution& solution,
                          double correlation_time_s, int draws, std::uint64_t seed, int threads) {
  const Problem plain = in_stated_sigmas(problem, Weights::dropped);
  const int arcs = static_cast<int>(plain.arcs.size());
  std::vector<Eigen::VectorXd> residuals(plain.arcs.size());
  std::vector<std::vector<SeriesOfReadings>> series(plain.arcs.size());
  data::Bootstrap result;
  result.draws = result.failed = draws;
  for (int arc = 0; arc < arcs; ++arc) {
    if (!evaluate(plain, arc, solution.u, residuals[arc], nullptr)) return result;
    series[arc] = series_of(plain.arcs[arc], correlation_time_s);
  }
  result.failed = 0;
  if (!series[0].empty())
    result.block_s = series[0][0].block * plain.arcs[0].duration_s() /
                     static_cast<double>(series[0][0].readings.size());
  // Residuals at the optimum are smaller than the noise by what the parameters took.
  const double rows = problem.rows();
  const double stretch =
      std::sqrt(rows / std::max(1.0, rows - static_cast<double>(problem.free.size())));
  std::vector<std::vector<double>> values(static_cast<std::size_t>(draws));
  data::in_parallel(values.size(), threads, [&](std::size_t draw) {
    std::seed_seq sequence{seed & 0xffffffffU, seed >> 32U, static_cast<std::uint64_t>(draw)};
    std::mt19937_64 generator(sequence);
    Problem drawn = plain;
    for (int arc = 0; arc < arcs; ++arc) {
      drawn.arcs[arc].noise_scale = problem.arcs[arc].noise_scale;
      resample(drawn.arcs[arc], series[arc], residuals[arc], stretch, generator);
    }
    values[draw] = fit_again(std::move(drawn), solution);
  });
  std::erase_if(values, [](const std::vector<double>& draw) { return draw.empty(); });
  result.failed = draws - static_cast<int>(values.size());
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i) {
    if (problem.free[i].held) continue;  // in all draws alike, which tells nothing
    std::vector<double> of_parameter;
    for (const std::vector<double>& draw : values)
      of_parameter.push_back(draw[static_cast<std::size_t>(i)]);
    if (of_parameter.size() > 1)
      result.parameters.push_back(spread_of(problem.name(i), std::move(of_parameter)));
  }
  return result;
}

}  // namespace trochoid::fitting
