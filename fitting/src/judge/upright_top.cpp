#include "judge/upright_top.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "judge/one_parameter.hpp"

namespace trochoid::fitting {
namespace {

// Where chi-square was looked at; the path goes with 1/l^2 but for terms of higher order.
struct Looked {
  double l_m, rise;
  [[nodiscard]] double root() const { return std::sqrt(std::max(rise, 0.0)); }
};

// Between one place inside a bound and one outside, where the root of the rise is nearly a straight
// line over 1/l^2.
double bound_between(const Looked& inside, const Looked& outside, double threshold) {
  const double k = 1.0 / (inside.l_m * inside.l_m), other = 1.0 / (outside.l_m * outside.l_m);
  const double share = (std::sqrt(threshold) - inside.root()) / (outside.root() - inside.root());
  return 1.0 / std::sqrt(k + share * (other - k));
}

class WalkOfLength {
 public:
  WalkOfLength(const Problem& problem, const Solution& solution, int length)
      : transform_(problem.free[length].transform),
        u_(solution.u[length]),
        parameter_(problem, solution, length) {}

  // Until chi-square is beyond doubt or the model ends; what is nearest comes first.
  template <std::size_t n>
  void go(const std::array<double, n>& factors, double beyond_doubt) {
    looked_ = {{transform_.value(u_), 0.0}};
    for (const double factor : factors) {
      const double l_m = factor * transform_.value(u_);
      const double rise = parameter_.rise(transform_.inverse(l_m) - u_, kSteps);
      if (!std::isfinite(rise)) return;
      looked_.push_back({l_m, rise});
      if (rise < lowest_.rise) lowest_ = {l_m, rise}, lowest_u_ = parameter_.all();
      if (rise > beyond_doubt) return;
    }
  }
  // Of the last place inside; empty where the walk ended inside.
  [[nodiscard]] std::optional<double> bound(double threshold) const {
    std::size_t last = looked_.size();
    while (looked_[last - 1].rise > threshold) --last;
    if (last == looked_.size()) return std::nullopt;
    return bound_between(looked_[last - 1], looked_[last], threshold);
  }
  [[nodiscard]] double end_m() const { return looked_.back().l_m; }
  [[nodiscard]] Eigen::VectorXd end() const { return parameter_.all(); }
  [[nodiscard]] double lowest() const { return lowest_.rise; }
  [[nodiscard]] const Eigen::VectorXd& lowest_u() const { return lowest_u_; }

 private:
  static constexpr SolveOptions kSteps{.iterations = 20, .function_tolerance = 1e-6};
  const Transform& transform_;
  double u_;
  OneParameter parameter_;
  std::vector<Looked> looked_;
  Looked lowest_{0.0, 0.0};
  Eigen::VectorXd lowest_u_;
};

// Its index where all arcs share one that is sought over decades; else -1.
int free_length(const Problem& problem) {
  const int l = problem.predictor->index_of("l_m");
  for (std::size_t i = 0; l >= 0 && i < problem.free.size(); ++i)
    if (problem.free[i].index == l && problem.free[i].transform.is_over_decades() &&
        !problem.free[i].held)
      return static_cast<int>(i);
  return -1;
}

}  // namespace

std::optional<UprightTop> upright_top(const Problem& problem, const Solution& solution,
                                      const Uncertainty& error) {
  constexpr double kSharply = 0.03, kWorth = 1.0, kBeyondDoubt = 100.0, kFar = 2.9;
  // The last leaves a thousandth of what tells l.
  constexpr std::array kLonger{1.2, 1.5, 2.0, 3.0, 5.0, 10.0, 30.0};
  constexpr std::array kShorter{0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01};
  const int length = free_length(problem);
  if (length < 0) return std::nullopt;
  const double l_m = problem.value(length, solution.u);
  if (std::sqrt(error.covariance(length, length)) < kSharply * l_m) return std::nullopt;
  const double inflation = error.chi2_inflation[length], threshold = kQuantile95 * inflation;
  UprightTop top{length, {}, 0.0, {}, {}};
  WalkOfLength longer(problem, solution, length);
  longer.go(kLonger, kBeyondDoubt * inflation);
  if (longer.lowest() < -kWorth) {
    Solution better = minimise(problem, longer.lowest_u());
    if (better.usable && better.chi2 < solution.chi2 - kWorth) {
      top.better = std::move(better);
      return top;
    }
  }
  top.far = longer.end();
  if ((top.most_m = longer.bound(threshold))) return top;
  if (longer.end_m() < kFar * l_m) return std::nullopt;  // the model ends before it tells
  WalkOfLength shorter(problem, solution, length);
  shorter.go(kShorter, threshold);
  top.least_m = shorter.bound(threshold).value_or(shorter.end_m());
  return top;
}

}  // namespace trochoid::fitting
