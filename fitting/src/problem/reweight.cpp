#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <optional>
#include <utility>

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

constexpr int kAll = -1;

// Whether a recording tells what its positions scatter by; a first guess is wrong by any factor.
bool tells_noise(const ArcData& arc, Channel channel) {
  return !arc.sigma_unknown || channel != Channel::position;
}

// The residual of one reading and what it counts for in the scale of their noise.
struct Length {
  double value = 0.0;  // 1 is expected of each coordinate
  double weight = 1.0;
};

// Of the residuals of a channel in one recording, or in all that tell their noise.
struct Lengths {
  std::vector<Length> alike;     // each counts as much as any other
  std::vector<Length> by_worth;  // each counts by its inverse variance
  double used = 0.0;             // degrees of freedom that the parameters take of them
  bool of_several = false;       // recordings, which state their noise each in its own way
};

// A position may be doubted along one direction only: what it scatters by along the other counts.
Length weighed(const Reading& reading, const Eigen::VectorXd& residuals) {
  if (reading.channel != Channel::position)
    return {std::abs(residuals[reading.row]), reading.whitener(0, 0) * reading.whitener(0, 0)};
  const double size = reading.whitener.norm() * std::numbers::sqrt2 / 2.0;
  if (!(size > 0.0)) return {0.0, 0.0};
  return {(reading.whitener * residuals.segment<2>(reading.row)).norm() / size, size * size};
}

double weighted_median(std::vector<Length> lengths) {
  std::sort(lengths.begin(), lengths.end(),
            [](const Length& a, const Length& b) { return a.value < b.value; });
  double half = 0.0;
  for (const Length& length : lengths) half += 0.5 * length.weight;
  for (const Length& length : lengths)
    if ((half -= length.weight) <= 0.0) return length.value;
  return 0.0;
}

// No reading counts for more than that which a tenth of them, ten at least, are better than.
void cap_weights(std::vector<Length>& lengths) {
  constexpr std::size_t kLeast = 10;
  std::vector<double> best;
  for (const Length& length : lengths) best.push_back(length.weight);
  std::sort(best.begin(), best.end(), std::greater<>());
  if (best.empty()) return;
  const double most = best[std::min(std::max(kLeast, best.size() / 10), best.size() - 1)];
  for (Length& length : lengths) length.weight = std::min(length.weight, most);
}

// What one recording alone determines is its own; what is common takes of each by its share.
Lengths lengths_of(const Problem& problem, const RawResiduals& raw, Channel channel, int track) {
  const auto among = [&](const ArcData& arc) {
    return track == kAll ? tells_noise(arc, channel) : arc.track == track;
  };
  Lengths lengths;
  std::map<int, double> rows, of_channel;  // by track
  for (std::size_t arc = 0; arc < problem.arcs.size(); ++arc) {
    const ArcData& data = problem.arcs[arc];
    rows[data.track] += data.rows;
    if (!among(data)) continue;
    for (const Reading& reading : data.readings) {
      if (reading.channel != channel) continue;
      lengths.alike.push_back({length(reading, raw.per_arc[arc]), 1.0});
      lengths.by_worth.push_back(weighed(reading, raw.per_arc[arc]));
      of_channel[data.track] += rows_of(channel);
    }
  }
  for (const auto& [of, count] : of_channel) {
    double own = 0.0;
    for (const FreeParameter& parameter : problem.free)
      own += parameter.arc >= 0 && problem.arcs[parameter.arc].track == of;
    lengths.used += own * count / rows[of] + problem.shared_count() * count / problem.rows();
  }
  cap_weights(lengths.by_worth);
  lengths.of_several = of_channel.size() > 1;
  return lengths;
}

struct Scale {
  double value = 1.0;
  double dof = 0.0;  // that it is known from
};

// Scale from the weighted squares of the inliers; robust start from the median.
Scale scale_of(const std::vector<Length>& lengths, double used, bool planar) {
  const double width = planar ? 2.0 : 1.0;
  // Median of |N(0,1)| is 0.6745, of the Rayleigh distribution 1.1774.
  double scale = weighted_median(lengths) / (planar ? 1.1774 : 0.6745);
  for (int round = 0; round < 5; ++round) {
    double squares = 0.0, inliers = 0.0;
    for (const Length& d : lengths)
      if (d.value <= kInlier * scale) {
        squares += d.weight * d.value * d.value;
        inliers += d.weight;
      }
    // Variance of what lies within kInlier sigmas.
    constexpr double kHalfSquare = 0.5 * kInlier * kInlier;
    const double beyond = std::exp(-kHalfSquare);
    const double kept =
        planar ? 2.0 * (1.0 - beyond * (1.0 + kHalfSquare)) / (1.0 - beyond)
               : 1.0 - 2.0 * kInlier * beyond /
                           (std::sqrt(2.0 * data::kPi) * std::erf(kInlier / std::numbers::sqrt2));
    scale = inliers > 0.0 ? std::sqrt(squares / (kept * inliers)) : 0.0;
  }
  double sum = 0.0, squares = 0.0;
  for (const Length& d : lengths) sum += d.weight, squares += d.weight * d.weight;
  const double rows = width * static_cast<double>(lengths.size());
  const double left = 1.0 - std::min(used, rows - 1.0) / rows;
  const double dof = std::max(1.0, width * sum * sum / squares * left);
  return {std::max(scale / std::sqrt(left), 1e-12), dof};
}

// Nothing where too few are read. A fit leans on its readings by their inverse variances: those
// known to be vague, which lie far nearer than they state, do not make the error bars of the others
// smaller.
std::optional<Scale> scale_of(const Lengths& lengths, bool planar) {
  if (lengths.alike.size() < 5) return std::nullopt;
  const Scale alike = scale_of(lengths.alike, lengths.used, planar);
  if (alike.value >= 1.0 || lengths.of_several) return alike;
  Scale best = scale_of(lengths.by_worth, lengths.used, planar);
  best.value = std::clamp(best.value, alike.value, 1.0);
  return best;
}

// Trackers misjudge their noise alike in recordings that are alike: what the others say counts as
// if it were so many readings of this one.
double beside_others(const Scale& own, const Scale& all) {
  constexpr double kOthers = 8.0;  // degrees of freedom
  return std::sqrt((own.dof * own.value * own.value + kOthers * all.value * all.value) /
                   (own.dof + kOthers));
}

// The scale of a channel in each recording.
std::map<int, double> scales_by_track(const Problem& problem, const RawResiduals& raw,
                                      Channel channel) {
  const bool planar = channel == Channel::position;
  const auto all = scale_of(lengths_of(problem, raw, channel, kAll), planar);
  std::map<int, bool> tells;
  for (const ArcData& arc : problem.arcs) tells[arc.track] = tells_noise(arc, channel);
  std::map<int, double> scales;
  for (const auto& [track, told] : tells) {
    const auto own = scale_of(lengths_of(problem, raw, channel, track), planar);
    if (own && told && all)
      scales[track] = tells.size() > 1 ? beside_others(*own, *all) : own->value;
    else if (own || (told && all))
      scales[track] = own ? own->value : all->value;
  }
  return scales;
}

// Scales of all arcs' channels. A motion that is wrong may leave nothing in one of them, as a body
// that is taken to lie leaves nothing across its axis: what the arc's others know of the noise
// bounds that, up to what is stated.
std::vector<std::array<double, kChannels>> noise_scales(const Problem& problem,
                                                        const RawResiduals& raw) {
  constexpr double kLeastBesideOthers = 0.01;  // what trackers state differs by ten times at most
  std::array<std::map<int, double>, kChannels> known;
  for (int c = 0; c < kChannels; ++c)
    known[c] = scales_by_track(problem, raw, static_cast<Channel>(c));
  std::vector<std::array<double, kChannels>> scales;
  for (const ArcData& arc : problem.arcs) {
    double most = 0.0;
    for (const auto& by_track : known)
      if (const auto at = by_track.find(arc.track); at != by_track.end())
        most = std::max(most, at->second);
    const double least = std::min(1.0, kLeastBesideOthers * most);
    scales.emplace_back();
    for (int c = 0; c < kChannels; ++c) {
      const auto at = known[c].find(arc.track);
      scales.back()[c] = at != known[c].end() ? std::max(at->second, least) : 1.0;
    }
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
