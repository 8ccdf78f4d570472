#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <utility>

#include "observe/smoothing.hpp"
#include "problem/problem.hpp"
#include "trochoid/data/angle.hpp"

namespace trochoid::fitting {
namespace {

// Whitened residuals without weights and noise scales.
struct RawResiduals {
  std::vector<Eigen::VectorXd> per_arc;
  bool ok = true;
};

RawResiduals raw_residuals(Problem problem, const Eigen::VectorXd& u) {
  RawResiduals raw;
  problem = in_stated_sigmas(std::move(problem), Weights::dropped);
  for (int arc = 0; arc < static_cast<int>(problem.arcs.size()); ++arc) {
    Eigen::VectorXd residuals;
    raw.ok = raw.ok && evaluate(problem, arc, u, residuals, nullptr);
    raw.per_arc.push_back(std::move(residuals));
  }
  return raw;
}

double length(const Reading& reading, const Eigen::VectorXd& residuals) {
  return reading.channel == Channel::position ? residuals.segment<2>(reading.row).norm()
                                              : std::abs(residuals[reading.row]);
}

// What a channel's scale is shared with: trackers misjudge their noise alike in all recordings, a
// first guess is wrong for each by itself.
constexpr int kAll = -1;
int sharing(const ArcData& arc, Channel channel) {
  return arc.sigma_unknown && channel == Channel::position ? arc.track : kAll;
}

// Lengths of a channel's residuals in the recordings that share its scale.
std::vector<double> lengths_of(const Problem& problem, const RawResiduals& raw, Channel channel,
                               int shared_by) {
  std::vector<double> lengths;
  for (std::size_t arc = 0; arc < problem.arcs.size(); ++arc) {
    if (sharing(problem.arcs[arc], channel) != shared_by) continue;
    for (const Reading& reading : problem.arcs[arc].readings)
      if (reading.channel == channel) lengths.push_back(length(reading, raw.per_arc[arc]));
  }
  return lengths;
}

// Scale from the weighted squares of the inliers, nothing where too few are read; robust start from
// the median.
std::optional<double> scale_of(const Problem& problem, const std::vector<double>& lengths,
                               bool planar) {
  if (lengths.size() < 5) return std::nullopt;
  // Median of |N(0,1)| is 0.6745, of the Rayleigh distribution 1.1774.
  double scale = median(lengths) / (planar ? 1.1774 : 0.6745);
  for (int round = 0; round < 5; ++round) {
    double squares = 0.0;
    int inliers = 0;
    for (const double d : lengths)
      if (d <= kInlier * scale) {
        squares += d * d;
        ++inliers;
      }
    // Variance of what lies within kInlier sigmas.
    constexpr double kHalfSquare = 0.5 * kInlier * kInlier;
    const double beyond = std::exp(-kHalfSquare);
    const double kept =
        planar ? 2.0 * (1.0 - beyond * (1.0 + kHalfSquare)) / (1.0 - beyond)
               : 1.0 - 2.0 * kInlier * beyond /
                           (std::sqrt(2.0 * data::kPi) * std::erf(kInlier / std::numbers::sqrt2));
    scale = std::sqrt(squares / std::max(1.0, kept * inliers));
  }
  const double rows = static_cast<double>(lengths.size()) * (planar ? 2.0 : 1.0);
  const double share = rows / std::max(1.0, static_cast<double>(problem.rows()));
  const double used = share * static_cast<double>(problem.free.size());
  return std::max(scale * std::sqrt(rows / std::max(1.0, rows - used)), 1e-12);
}

// Scales of all arcs' channels. A motion that is wrong may leave nothing in one of them, as a body
// that is taken to lie leaves nothing across its axis: what the arc's others know of the noise
// bounds that, up to what is stated.
std::vector<std::array<double, kChannels>> noise_scales(const Problem& problem,
                                                        const RawResiduals& raw) {
  constexpr double kLeastBesideOthers = 0.01;  // what trackers state differs by ten times at most
  std::map<std::pair<int, int>, std::optional<double>> known;  // by channel and who shares it
  std::vector<std::array<double, kChannels>> scales;
  for (const ArcData& arc : problem.arcs) {
    std::array<std::optional<double>, kChannels> of_arc;
    double most = 0.0;
    for (int c = 0; c < kChannels; ++c) {
      const auto channel = static_cast<Channel>(c);
      const int shared_by = sharing(arc, channel);
      const auto [at, is_new] = known.try_emplace({c, shared_by});
      if (is_new)
        at->second = scale_of(problem, lengths_of(problem, raw, channel, shared_by),
                              channel == Channel::position);
      of_arc[c] = at->second;
      most = std::max(most, of_arc[c].value_or(0.0));
    }
    const double least = std::min(1.0, kLeastBesideOthers * most);
    scales.emplace_back();
    for (int c = 0; c < kChannels; ++c)
      scales.back()[c] = of_arc[c] ? std::max(*of_arc[c], least) : 1.0;
  }
  return scales;
}

}  // namespace

double reweight(Problem& problem, const Eigen::VectorXd& u, bool rescale) {
  const RawResiduals raw = raw_residuals(problem, u);
  if (!raw.ok) return 0.0;
  double change = 0.0;
  const std::vector<std::array<double, kChannels>> scales = noise_scales(problem, raw);
  for (std::size_t arc = 0; arc < problem.arcs.size(); ++arc) {
    const std::array<double, kChannels>& spread = scales[arc];
    if (rescale) {
      std::array<double, kChannels>& before = problem.arcs[arc].noise_scale;
      for (int c = 0; c < kChannels; ++c)
        change = std::max(change, std::abs(std::log(spread[c] / before[c])));
      before = spread;
    }
    Eigen::VectorXd weights = Eigen::VectorXd::Ones(problem.arcs[arc].rows);
    for (const Reading& reading : problem.arcs[arc].readings) {
      const double d =
          length(reading, raw.per_arc[arc]) / spread[static_cast<int>(reading.channel)];
      if (d <= kInlier) continue;
      // Influence falls like 1/d^3: a glitch far away does not pull.
      const double weight = kInlier * kInlier / (d * d);
      weights.segment(reading.row, rows_of(reading.channel)).setConstant(weight);
    }
    const Eigen::VectorXd& before = problem.row_weights[arc];
    change = std::max(change, before.size() == weights.size()
                                  ? (before - weights).cwiseAbs().maxCoeff()
                                  : (weights.array() - 1.0).abs().maxCoeff());
    problem.row_weights[arc] = std::move(weights);
  }
  return change;
}

double robust_weight(const Problem& problem, int arc, const Reading& reading) {
  const Eigen::VectorXd& weights = problem.row_weights[static_cast<std::size_t>(arc)];
  return weights.size() > 0 ? weights[reading.row] : 1.0;
}

double cost_of_standing_out(const Problem& problem, Channel channel) {
  double cost = 0.0;
  for (std::size_t arc = 0; arc < problem.arcs.size(); ++arc)
    for (const Reading& reading : problem.arcs[arc].readings)
      if (reading.channel == channel)
        cost += 2.0 * kInlier * kInlier *
                (1.0 - robust_weight(problem, static_cast<int>(arc), reading));
  return cost;
}

}  // namespace trochoid::fitting
