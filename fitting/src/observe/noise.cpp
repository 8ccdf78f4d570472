#include "observe/noise.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "observe/decompositions.hpp"

namespace trochoid::fitting {
namespace {

// The Kalman filter that follows the autoregressive part of so many kinds of noise side by side.
// What it knows of the next sample settles after a few; from then on nothing is divided.
template <int kKinds>
class Follower {
 public:
  using Array = Eigen::Array<double, kKinds, 1>;
  Follower(const Array& share, const Array& rho)
      : share_(share), rho_(rho), root_(share.sqrt()), predicted_(Array::Ones()) {
    look_ahead();
  }
  [[nodiscard]] const Array& root() const { return root_; }
  [[nodiscard]] const Array& rho() const { return rho_; }
  [[nodiscard]] const Array& gain() const { return gain_; }
  [[nodiscard]] const Array& variance() const { return variance_; }  ///< of the innovation
  [[nodiscard]] const Array& inverse() const { return inverse_; }    ///< of that
  [[nodiscard]] Array log_determinant() const { return logs_ + product_.log(); }

  void advance() {
    // Factors of no less than 1e-8 each.
    constexpr int kFactors = 32;
    product_ *= variance_;
    if (++factors_ == kFactors) {
      logs_ += product_.log();
      product_.setOnes();
      factors_ = 0;
    }
    if (settled_) return;
    constexpr double kSettled = 1e-15;
    const Array rho2 = rho_.square();
    const Array next = rho2 * predicted_ * (1.0 - gain_ * root_) + 1.0 - rho2;
    settled_ = ((next - predicted_).abs() < kSettled).all();
    predicted_ = next;
    look_ahead();
  }

 private:
  void look_ahead() {
    variance_ = share_ * predicted_ + (1.0 - share_);
    inverse_ = variance_.inverse();
    gain_ = root_ * predicted_ * inverse_;
  }
  Array share_, rho_, root_, predicted_, variance_, inverse_, gain_;
  Array product_ = Array::Ones(), logs_ = Array::Zero();
  int factors_ = 0;
  bool settled_ = false;
};

// Innovations of that filter in place of series, one per row, time along the columns; each over its
// standard deviation. @returns the logarithm of the determinant of the correlation matrix.
double filter(const NoiseKind& kind, Eigen::MatrixXd& series) {
  using One = Follower<1>::Array;
  Follower<1> follower(One(kind.share), One(kind.rho));
  const double root = follower.root()[0];
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(series.rows());
  for (Eigen::Index t = 0; t < series.cols(); ++t) {
    const double gain = follower.gain()[0];
    auto now = series.col(t);
    now -= root * mean;
    mean += gain * now;
    mean *= kind.rho;
    now *= std::sqrt(follower.inverse()[0]);
    follower.advance();
  }
  return follower.log_determinant()[0];
}

// What one group adds to twice the negative logarithm of the likelihood.
struct Likelihood {
  double log_determinant = 0.0, squares = 0.0, left = 0.0;
};

// What the parameters take of the series of a group and, last, the residuals: one per row, as
// filter() works on them.
std::vector<Eigen::MatrixXd> rows_of(const NoiseGroup& group) {
  std::vector<Eigen::MatrixXd> all;
  for (const NoiseSeries& one : group) {
    Eigen::MatrixXd rows(one.taken.cols() + 1, one.residual.size());
    rows << one.taken.transpose(), one.residual.transpose();
    all.push_back(std::move(rows));
  }
  return all;
}

// Restricted: what the parameters take is left out of account.
void add(const std::vector<Eigen::MatrixXd>& group, const NoiseKind& kind, Likelihood& sum) {
  const Eigen::Index taken = group.front().rows() - 1;
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(taken, taken);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(taken);
  Eigen::MatrixXd whitened;
  for (const Eigen::MatrixXd& rows : group) {
    whitened = rows;
    sum.log_determinant += filter(kind, whitened);
    const auto w = whitened.topRows(taken);
    const auto r = whitened.row(taken);
    normal.noalias() += w * w.transpose();
    right.noalias() += w * r.transpose();
    sum.squares += r.squaredNorm();
    sum.left += static_cast<double>(rows.cols());
  }
  if (taken == 0) return;
  const SymmetricEquations equations(normal);
  sum.squares -= right.dot(equations.solve(right));
  sum.log_determinant += equations.log_determinant();
  sum.left -= static_cast<double>(taken);
}

// Twice the negative logarithm of the likelihood with the best variance.
double minus2_log_likelihood(const Likelihood& sum, double& variance) {
  variance = std::max(sum.squares / sum.left, 1e-300);
  return sum.log_determinant + sum.left * std::log(variance);
}

// Of the residuals as they are, for all kinds; these are given the best variance.
std::vector<double> plain_minus2_logs(const std::vector<NoiseGroup>& groups,
                                      std::vector<NoiseKind>& kinds) {
  constexpr int kTogether = 8;
  using Lanes = Follower<kTogether>::Array;
  std::vector<double> minus2_logs(kinds.size());
  for (std::size_t first = 0; first < kinds.size(); first += kTogether) {
    Lanes share = Lanes::Zero(), rho = Lanes::Zero();
    const int count = static_cast<int>(std::min<std::size_t>(kTogether, kinds.size() - first));
    for (int k = 0; k < count; ++k) {
      share[k] = kinds[first + static_cast<std::size_t>(k)].share;
      rho[k] = kinds[first + static_cast<std::size_t>(k)].rho;
    }
    Lanes squares = Lanes::Zero(), log_determinant = Lanes::Zero();
    double left = 0.0;
    for (const NoiseGroup& group : groups)
      for (const NoiseSeries& one : group) {
        Follower<kTogether> follower(share, rho);
        Lanes mean = Lanes::Zero();
        for (const double residual : one.residual) {
          const Lanes innovation = residual - follower.root() * mean;
          mean = follower.rho() * (mean + follower.gain() * innovation);
          squares += innovation.square() * follower.inverse();
          follower.advance();
        }
        log_determinant += follower.log_determinant();
        left += static_cast<double>(one.residual.size());
      }
    for (int k = 0; k < count; ++k) {
      const std::size_t i = first + static_cast<std::size_t>(k);
      minus2_logs[i] =
          minus2_log_likelihood({log_determinant[k], squares[k], left}, kinds[i].variance);
    }
  }
  return minus2_logs;
}

double restricted_minus2_log_likelihood(const std::vector<std::vector<Eigen::MatrixXd>>& groups,
                                        NoiseKind& kind) {
  Likelihood sum;
  for (const auto& group : groups) add(group, kind, sum);
  return minus2_log_likelihood(sum, kind.variance);
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
    kind.posterior =
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
  std::vector<double> minus2_logs = plain_minus2_logs(groups, kinds);
  const double plain = *std::min_element(minus2_logs.begin(), minus2_logs.end());
  std::vector<std::vector<Eigen::MatrixXd>> rows_of_all;
  for (const NoiseGroup& group : groups) rows_of_all.push_back(rows_of(group));
  constexpr double kNegligible = 1e-3;
  // The parameters' part of the likelihood is worth, for each of them, the logarithm of how much
  // more noise there is at its frequencies, at most the inflation, and a little for what they would
  // rather follow of such noise: where the plain one and what is known beforehand leave next to no
  // posterior beyond that, they say enough.
  constexpr double kRather = 2.0;
  const auto doubt = [&](std::size_t i) {
    return minus2_logs[i] - 2.0 * std::log(kinds[i].posterior);
  };
  double least_doubt = doubt(0);
  for (std::size_t i = 1; i < kinds.size(); ++i) least_doubt = std::min(least_doubt, doubt(i));
  const double far = least_doubt - 2.0 * std::log(kNegligible);
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    const double of_each = kRather + std::log(kinds[i].inflation());
    minus2_logs[i] = doubt(i) > far + of_each * static_cast<double>(taken)
                         ? std::numeric_limits<double>::infinity()
                         : restricted_minus2_log_likelihood(rows_of_all, kinds[i]);
  }
  const double least = *std::min_element(minus2_logs.begin(), minus2_logs.end());
  for (std::size_t i = 0; i < kinds.size(); ++i)
    kinds[i].posterior *= std::exp(-0.5 * (minus2_logs[i] - least));
  const auto normalise = [&] {
    double all = 0.0;
    for (const NoiseKind& kind : kinds) all += kind.posterior;
    for (NoiseKind& kind : kinds) kind.posterior /= all;
  };
  normalise();
  std::erase_if(kinds, [&](const NoiseKind& kind) { return kind.posterior < kNegligible; });
  normalise();
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
  Eigen::MatrixXd series = x.transpose();
  filter(kind, series);
  return series.transpose();
}

}  // namespace trochoid::fitting
