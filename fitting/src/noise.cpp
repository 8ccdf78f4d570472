#include "noise.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace trochoid::fitting {
namespace {

// Innovations of the Kalman filter that follows the autoregressive part, each over its standard
// deviation. @returns the logarithm of the determinant of the correlation matrix.
double filter(const NoiseKind& kind, const Eigen::MatrixXd& x, Eigen::MatrixXd& out) {
  const double root = std::sqrt(kind.share), white = 1.0 - kind.share;
  const double rho2 = kind.rho * kind.rho;
  // Column by column in memory, row by row in time: worked on transposed.
  Eigen::MatrixXd rows = x.transpose();
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(x.cols());
  double predicted = 1.0, log_determinant = 0.0;
  for (Eigen::Index t = 0; t < rows.cols(); ++t) {
    const double variance = kind.share * predicted + white;
    const double gain = root * predicted / variance;
    auto row = rows.col(t);
    row -= root * mean;
    mean = kind.rho * (mean + gain * row);
    row /= std::sqrt(variance);
    log_determinant += std::log(variance);
    predicted = rho2 * (predicted - gain * root * predicted) + 1.0 - rho2;
  }
  out = rows.transpose();
  return log_determinant;
}

// What one group adds to twice the negative logarithm of the likelihood.
struct Likelihood {
  double log_determinant = 0.0, squares = 0.0, left = 0.0;
};

// Restricted: what the parameters take is left out of account.
void add(const NoiseGroup& group, const NoiseKind& kind, bool restricted, Likelihood& sum) {
  const Eigen::Index taken = restricted ? group.front().taken.cols() : 0;
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(taken, taken);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(taken);
  Eigen::MatrixXd whitened;
  for (const NoiseSeries& one : group) {
    Eigen::MatrixXd both(one.residual.size(), taken + 1);
    both.col(0) = one.residual;
    both.rightCols(taken) = one.taken.leftCols(taken);
    sum.log_determinant += filter(kind, both, whitened);
    const auto w = whitened.rightCols(taken);
    normal.noalias() += w.transpose() * w;
    right.noalias() += w.transpose() * whitened.col(0);
    sum.squares += whitened.col(0).squaredNorm();
    sum.left += static_cast<double>(one.residual.size());
  }
  if (taken == 0) return;
  const Eigen::LDLT<Eigen::MatrixXd> ldlt(normal);
  sum.squares -= right.dot(ldlt.solve(right));
  sum.log_determinant += ldlt.vectorD().cwiseMax(1e-300).array().log().sum();
  sum.left -= static_cast<double>(taken);
}

// Twice the negative logarithm of the likelihood with the best variance, which the kind is given.
double surprise(const std::vector<NoiseGroup>& groups, bool restricted, NoiseKind& kind) {
  Likelihood sum;
  for (const NoiseGroup& group : groups) add(group, kind, restricted, sum);
  kind.variance = std::max(sum.squares / sum.left, 1e-300);
  return sum.log_determinant + sum.left * std::log(kind.variance);
}

// White noise, and a grid over the shares and the correlation times, these evenly in their
// logarithm up to where a process looks like an offset.
std::vector<NoiseKind> candidates(Eigen::Index longest) {
  constexpr double kWhiteBefore = 0.8;
  constexpr std::array kShares{0.15, 0.3, 0.45, 0.6, 0.75, 0.9, 1.0};
  constexpr double kShortest = 0.6, kStep = 1.5, kLongest = 0.25;  // samples; of the series
  std::vector<NoiseKind> kinds{{}};
  for (double time = kShortest; time < kLongest * static_cast<double>(longest); time *= kStep)
    for (const double share : kShares) kinds.push_back({share, std::exp(-1.0 / time)});
  for (NoiseKind& kind : kinds) {
    const bool white = kind.share == 0.0;
    kind.belief =
        white ? kWhiteBefore : (1.0 - kWhiteBefore) / static_cast<double>(kinds.size() - 1);
  }
  return kinds;
}

}  // namespace

NoiseEvidence noise_evidence(const std::vector<NoiseGroup>& groups) {
  constexpr Eigen::Index kFewest = 20;
  Eigen::Index longest = 0, rows = 0, taken = 0;
  double power = 0.0;
  for (const NoiseGroup& group : groups) {
    for (const NoiseSeries& one : group) {
      longest = std::max(longest, one.residual.size());
      rows += one.residual.size();
      power += one.residual.squaredNorm();
    }
    taken += group.front().taken.cols();
  }
  if (!(power > 0.0)) return {};
  if (longest < kFewest || rows < 2 * taken)
    return {{NoiseKind{}}, static_cast<double>(rows) * std::log(power / static_cast<double>(rows))};
  std::vector<NoiseKind> kinds = candidates(longest);
  std::vector<double> surprises(kinds.size());
  for (std::size_t i = 0; i < kinds.size(); ++i) surprises[i] = surprise(groups, false, kinds[i]);
  const double plain = *std::min_element(surprises.begin(), surprises.end());
  // The parameters' part of the likelihood is worth some logarithms each: where the plain one is
  // far beyond those, the plain one says enough.
  const double far = 30.0 + 8.0 * static_cast<double>(taken);
  for (std::size_t i = 0; i < kinds.size(); ++i)
    surprises[i] = surprises[i] > plain + far ? std::numeric_limits<double>::infinity()
                                              : surprise(groups, true, kinds[i]);
  const double least = *std::min_element(surprises.begin(), surprises.end());
  for (std::size_t i = 0; i < kinds.size(); ++i)
    kinds[i].belief *= std::exp(-0.5 * (surprises[i] - least));
  const auto share_belief = [&] {
    double all = 0.0;
    for (const NoiseKind& kind : kinds) all += kind.belief;
    for (NoiseKind& kind : kinds) kind.belief /= all;
  };
  constexpr double kNegligible = 1e-3;
  share_belief();
  std::erase_if(kinds, [&](const NoiseKind& kind) { return kind.belief < kNegligible; });
  share_belief();
  return {std::move(kinds), plain};
}

Eigen::MatrixXd seen_through(const NoiseKind& kind, const Eigen::MatrixXd& x) {
  Eigen::MatrixXd product = x.transpose() * x;
  if (kind.share == 0.0) return product;
  // Sum over lags > 0 of rho^lag x(t - lag), running along the rows.
  const Eigen::MatrixXd rows = x.transpose();
  Eigen::MatrixXd before = Eigen::MatrixXd::Zero(rows.rows(), rows.cols());
  for (Eigen::Index t = 1; t < rows.cols(); ++t)
    before.col(t) = kind.rho * (before.col(t - 1) + rows.col(t - 1));
  const Eigen::MatrixXd across = rows * before.transpose();
  return product + kind.share * (across + across.transpose());
}

Eigen::MatrixXd decorrelated(const NoiseKind& kind, const Eigen::MatrixXd& x) {
  Eigen::MatrixXd out;
  filter(kind, x, out);
  return out;
}

}  // namespace trochoid::fitting
