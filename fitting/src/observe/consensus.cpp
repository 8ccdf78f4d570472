#include "observe/consensus.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "observe/smoothing.hpp"
#include "trochoid/data/quantile.hpp"
#include "trochoid/data/white_jerk.hpp"

namespace trochoid::fitting {
namespace {

constexpr int kMostSkipped = 45;  // wrong samples in a row
constexpr double kReward = 7.0;   // a sample 3.7 standard deviations off is worth nothing

// Position, velocity and acceleration with their covariance, the same for both coordinates.
struct SampleMotion {
  Eigen::Matrix<double, 3, 2> state = Eigen::Matrix<double, 3, 2>::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double gain = -std::numeric_limits<double>::infinity();  // of the chain up to here
  int before = -1;
  int length = 1;  // of the chain
};

struct NoisyPath {
  std::span<const double> t_s;
  const Eigen::MatrixX2d& xy_m;
  std::span<const double> sigma_m;
  double speed_m_s = 0.0, acceleration_m_s2 = 0.0;  // beyond those of any sample that counts
  double noise_m = 0.0, step_s = 0.0;               // typical ones
};

// First sample of a chain: nothing is known of how it moves.
SampleMotion begun(const NoisyPath& path, int at) {
  SampleMotion motion;
  motion.state.row(0) = path.xy_m.row(at);
  motion.covariance.diagonal() << path.sigma_m[at] * path.sigma_m[at],
      path.speed_m_s * path.speed_m_s, path.acceleration_m_s2 * path.acceleration_m_s2;
  motion.gain = 0.0;
  return motion;
}

// Variance of a position predicted tau later.
double predicted_variance(const Eigen::Matrix3d& p, double tau, double jerk2_s) {
  const double half = 0.5 * tau * tau;
  return p(0, 0) + tau * (2.0 * p(0, 1) + tau * p(1, 1)) +
         half * (2.0 * p(0, 2) + 2.0 * tau * p(1, 2) + half * p(2, 2)) +
         jerk2_s * tau * tau * tau * tau * tau / 20.0;
}

// What sample `at` gains when it follows `before`.
double gain_of(const NoisyPath& path, const SampleMotion& before, double tau, int at,
               double jerk2_s) {
  const double noise = path.sigma_m[at] * path.sigma_m[at];
  const double variance = predicted_variance(before.covariance, tau, jerk2_s) + noise;
  const Eigen::RowVector2d off = path.xy_m.row(at) - before.state.row(0) -
                                 tau * before.state.row(1) - 0.5 * tau * tau * before.state.row(2);
  // While a chain learns how fast it goes nothing is expected of it, else none would ever begin.
  constexpr int kLearning = 3;
  constexpr double kLittle = 1.0;
  double penalty = std::log(variance / noise);
  if (before.length < kLearning) penalty = std::min(penalty, kReward - kLittle);
  return kReward - 0.5 * off.squaredNorm() / variance - penalty;
}

SampleMotion advanced(const NoisyPath& path, const SampleMotion& before, double tau, int at,
                      double jerk2_s) {
  const Eigen::Matrix3d move = data::white_jerk_transition(tau);
  SampleMotion motion;
  motion.state = move * before.state;
  motion.covariance =
      move * before.covariance * move.transpose() + jerk2_s * data::white_jerk_covariance(tau);
  const double noise = path.sigma_m[at] * path.sigma_m[at];
  const Eigen::Vector3d kalman = motion.covariance.col(0) / (motion.covariance(0, 0) + noise);
  motion.state += kalman * (path.xy_m.row(at) - motion.state.row(0));
  motion.covariance -= kalman * motion.covariance.row(0).eval();
  return motion;
}

struct SampleChain {
  double gain = -std::numeric_limits<double>::infinity();
  std::vector<int> samples;
};

// Among samples [from, to).
SampleChain best_chain(const NoisyPath& path, int from, int to, double jerk2_s) {
  std::vector<SampleMotion> motions(
      static_cast<std::size_t>(to));  // those before `from` stay unused
  for (int at = from; at < to; ++at) {
    SampleMotion best = begun(path, at);
    for (int before = std::max(from, at - 1 - kMostSkipped); before < at; ++before) {
      const double tau = path.t_s[at] - path.t_s[before];
      const double gain = motions[before].gain + gain_of(path, motions[before], tau, at, jerk2_s);
      if (gain > best.gain) best.gain = gain, best.before = before;
    }
    if (best.before >= 0) {
      SampleMotion motion =
          advanced(path, motions[best.before], path.t_s[at] - path.t_s[best.before], at, jerk2_s);
      motion.gain = best.gain, motion.before = best.before;
      motion.length = motions[best.before].length + 1;
      best = motion;
    }
    motions[at] = best;
  }
  const auto end = std::max_element(motions.begin() + from, motions.end(),
                                    [](const auto& a, const auto& b) { return a.gain < b.gain; });
  SampleChain chain{end->gain, {}};
  for (int at = static_cast<int>(end - motions.begin()); at >= 0; at = motions[at].before)
    chain.samples.push_back(at);
  std::reverse(chain.samples.begin(), chain.samples.end());
  return chain;
}

// Sizes of the second differences over steps of the samples in order; the upper ones are those of
// wrong places.
std::vector<double> second_differences(const NoisyPath& path) {
  std::vector<double> sizes;
  for (Eigen::Index i = 1; i + 1 < path.xy_m.rows(); ++i) {
    const double share = (path.t_s[i] - path.t_s[i - 1]) / (path.t_s[i + 1] - path.t_s[i - 1]);
    const Eigen::RowVector2d way = path.xy_m.row(i + 1) - path.xy_m.row(i - 1);
    sizes.push_back((path.xy_m.row(i) - path.xy_m.row(i - 1) - share * way).norm());
  }
  return sizes;
}

// How much of the samples [from, to) chains explain with a jerk: stretches from all over them,
// since a body may lie at rest when the record begins, or be at rest when it ends.
double gain_with(const NoisyPath& path, int from, int to, double jerk2_s) {
  constexpr int kStretches = 4, kLength = 250;
  if (to - from <= kStretches * kLength) return best_chain(path, from, to, jerk2_s).gain;
  double gain = 0.0;
  for (int i = 0; i < kStretches; ++i) {
    const int first = from + (to - from - kLength) * i / (kStretches - 1);
    gain += best_chain(path, first, first + kLength, jerk2_s).gain;
  }
  return gain;
}

// The chain through the samples [from, to), with the jerk that explains most of them.
SampleChain best_chain(const NoisyPath& path, int from, int to) {
  constexpr std::array kOverNoise{0.01, 0.05, 0.2, 1.0, 5.0, 20.0};  // it adds from step to step
  double jerk2_s = 0.0, highest = -std::numeric_limits<double>::infinity();
  for (const double over : kOverNoise) {
    const double trial = 20.0 * std::pow(over * path.noise_m, 2) / std::pow(path.step_s, 5);
    const double gain = gain_with(path, from, to, trial);
    if (gain > highest) highest = gain, jerk2_s = trial;
  }
  return best_chain(path, from, to, jerk2_s);
}

// Whether samples [from, to) are one smooth way: velocities change little as a rule from one to the
// next, and none is much larger than both beside it.
bool goes_smoothly(const NoisyPath& path, int from, int to) {
  constexpr double kLonger = 2.0, kNoises = 5.0;
  constexpr double kSmooth = 0.5;  // of the larger one; between places without a way more than 1
  std::vector<Eigen::RowVector2d> m_s;
  std::vector<double> noises_m_s;
  for (int i = from + 1; i < to; ++i) {
    const double tau = path.t_s[i] - path.t_s[i - 1];
    m_s.emplace_back((path.xy_m.row(i) - path.xy_m.row(i - 1)) / tau);
    noises_m_s.push_back(kNoises * std::hypot(path.sigma_m[i - 1], path.sigma_m[i]) / tau);
  }
  std::vector<double> changes;
  for (std::size_t i = 1; i < m_s.size(); ++i) {
    const double before = m_s[i - 1].norm(), now = m_s[i].norm();
    changes.push_back((m_s[i] - m_s[i - 1]).norm() / std::max({before, now, 1e-300}));
    if (i + 1 < m_s.size() && now > kLonger * std::max(before, m_s[i + 1].norm()) + noises_m_s[i])
      return false;
  }
  return !changes.empty() && median_or_zero(std::move(changes)) < kSmooth;
}

// A chain that could not go on for long has met another kind of motion, not wrong places: a body at
// rest that is struck, one that begins to wobble. What lies beyond its ends is looked at by itself;
// so few samples that they may be wrong places are kept where they lead up to it.
void keep_consistent(const NoisyPath& path, int from, int to, std::vector<int>& kept) {
  constexpr int kMostWrong = 20, kFewest = 12, kFewestBeyond = 5;
  const std::vector<int> chain = best_chain(path, from, to).samples;
  // What hardly hangs together anywhere is not doubted.
  if (static_cast<int>(chain.size()) < kFewest ||
      2 * static_cast<int>(chain.size()) < chain.back() - chain.front()) {
    for (int at = from; at < to; ++at) kept.push_back(at);
    return;
  }
  // Some of the chain on the way, to see how it goes on.
  constexpr int kOfChain = 3;
  const auto beyond = [&](int first, int last, int seen_from, int seen_to) {
    if (last - first > kMostWrong)
      keep_consistent(path, first, last, kept);
    else if (last - first >= kFewestBeyond && goes_smoothly(path, seen_from, seen_to))
      for (int at = first; at < last; ++at) kept.push_back(at);
  };
  beyond(from, chain.front(), from, std::min(to, chain.front() + kOfChain));
  kept.insert(kept.end(), chain.begin(), chain.end());
  beyond(chain.back() + 1, to, std::max(from, chain.back() + 1 - kOfChain), to);
}

}  // namespace

std::vector<int> consistent_path(std::span<const double> t_s, const Eigen::MatrixX2d& xy_m,
                                 std::span<const double> sigma_m) {
  const int n = static_cast<int>(t_s.size());
  std::vector<int> all(t_s.size());
  std::iota(all.begin(), all.end(), 0);
  if (n < 12) return all;
  NoisyPath path{t_s, xy_m, sigma_m};
  const std::vector<double> bends = second_differences(path);
  constexpr double kOrdinary = 8.0;  // times a low quantile: curvature varies by a few
  if (*std::max_element(bends.begin(), bends.end()) < kOrdinary * data::quantile(bends, 0.3))
    return all;
  // A low quantile of what noise and bends make together bounds the noise: stated sigmas may be
  // too small, and what is wrong here and there must not pass for noise.
  constexpr double kRayleigh = 0.845, kWeights = 1.225;  // 0.3 quantile; of (-1/2, 1, -1/2)
  const double stated_m = median_or_zero({sigma_m.begin(), sigma_m.end()});
  const double bound_m = data::quantile(bends, 0.3) / (kRayleigh * kWeights);
  const double noise_m = std::max(stated_m, std::min(bound_m, noise_about_smooth_curve(t_s, xy_m)));
  std::vector<double> noises_m;
  for (const double sigma : sigma_m) noises_m.push_back(sigma * noise_m / stated_m);
  path.sigma_m = noises_m;
  std::vector<double> steps_s, speeds;
  for (int i = 1; i < n; ++i) {
    steps_s.push_back(t_s[i] - t_s[i - 1]);
    speeds.push_back((xy_m.row(i) - xy_m.row(i - 1)).norm() / steps_s.back());
  }
  path.noise_m = noise_m;
  path.step_s = median_or_zero(steps_s);
  path.speed_m_s = 3.0 * data::quantile(speeds, 0.7);
  path.acceleration_m_s2 = path.speed_m_s / (4.0 * path.step_s);
  std::vector<int> kept;
  keep_consistent(path, 0, n, kept);
  return kept;
}

}  // namespace trochoid::fitting
