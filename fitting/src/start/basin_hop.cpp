#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <random>
#include <span>

#include "start/strategy.hpp"

namespace trochoid::fitting {
namespace {

// How far a parameter may be thrown in u where the data say nothing.
double leap(const Problem& problem, const FreeParameter& parameter, double u) {
  if (parameter.transform.is_over_decades()) return 0.5;
  const std::string& unit = problem.predictor->parameters()[parameter.index].unit;
  return (unit == "rad" ? 0.2 : 0.0) + 0.1 * std::abs(u);
}

// A factor L of the covariance L L^T of the linearised problem at u, for residuals of the size they
// have; empty where there is no prediction.
Eigen::MatrixXd reach(const Problem& problem, const Eigen::VectorXd& u, double reduced_chi2) {
  Eigen::VectorXd residuals;
  Eigen::MatrixXd jacobian;
  if (!evaluate(problem, 0, u, residuals, &jacobian, false)) return {};
  Eigen::MatrixXd information = jacobian.transpose() * jacobian / std::max(1.0, reduced_chi2);
  for (Eigen::Index i = 0; i < u.size(); ++i) {
    const double far = leap(problem, problem.free[i], u[i]) + 1e-9;
    information(i, i) += 1.0 / (far * far);
  }
  const Eigen::LLT<Eigen::MatrixXd> cholesky(information);
  if (cholesky.info() != Eigen::Success) return {};
  return cholesky.matrixU().solve(Eigen::MatrixXd::Identity(u.size(), u.size()));
}

// Tries random places about a solution instead of going downhill from each: values are far
// cheaper than derivatives. Reproducible.
class RandomTrials {
 public:
  explicit RandomTrials(const Problem& problem) : problem_(problem) {}
  // The place that leaves least, by steps in turn along the columns of L; empty where the model
  // ends at all of them. What is held stays as it is in `held`.
  Eigen::VectorXd best(int count, const Eigen::VectorXd& about, const Eigen::MatrixXd& L,
                       std::span<const double> steps, const Eigen::VectorXd& held) {
    double least = std::numeric_limits<double>::infinity();
    Eigen::VectorXd from, residuals;
    for (int trial = 0; trial < count; ++trial) {
      Eigen::VectorXd z(L.cols());
      for (double& entry : z) entry = normal_(generator_);
      Eigen::VectorXd u = about + steps[static_cast<std::size_t>(trial) % steps.size()] * (L * z);
      for (Eigen::Index k = 0; k < u.size(); ++k)
        if (problem_.free[k].held) u[k] = held[k];
      if (!evaluate(problem_, 0, u, residuals, nullptr) || residuals.squaredNorm() >= least)
        continue;
      least = residuals.squaredNorm();
      from = u;
    }
    return from;
  }

 private:
  const Problem& problem_;
  std::mt19937_64 generator_{1};
  std::normal_distribution<double> normal_;
};

// A solution for the longest part of the track before an instant that one explains.
struct Prelude {
  Problem part;
  Solution solution;
};

std::optional<Prelude> before(const Problem& problem, const Eigen::VectorXd& u, double t_s) {
  constexpr int kFewest = 16;
  constexpr double kLeast = 0.3, kShorter = 0.85;
  const std::vector<double>& all_s = problem.arcs[0].t_s;
  const auto samples =
      static_cast<double>(std::lower_bound(all_s.begin(), all_s.end(), t_s) - all_s.begin());
  Prelude prelude{problem, {}};
  prelude.solution.u = u;
  // The body may have fallen before the model does.
  for (double share = 1.0; share > kLeast && share * samples > kFewest; share *= kShorter) {
    prelude.part.arcs[0] = problem.arcs[0].slice(0, static_cast<int>(share * samples));
    const SolveOptions options{.iterations = 25, .function_tolerance = 1e-4};
    Solution solution = minimise(prelude.part, prelude.solution.u, options);
    if (!solution.usable) continue;
    prelude.solution = std::move(solution);
    if (judged(prelude.part, prelude.solution, "").passed) return prelude;
  }
  return std::nullopt;
}

}  // namespace

Found restart_around_fall(const Problem& problem, Found found) {
  constexpr int kRounds = 4, kTrials = 60;
  constexpr double kSteps[] = {0.5, 1.0, 2.0, 3.0};
  constexpr double kTellsSomething = 0.3;  // of the variance
  if (!found.solution.usable || found.passed || found.unexplained > kTellsSomething) return found;
  const auto fall_s = falls_at_s(problem, found.solution.u);
  if (!fall_s) return found;
  const auto prelude = before(problem, found.solution.u, *fall_s);
  if (!prelude) return found;
  const Eigen::MatrixXd L = reach(prelude->part, prelude->solution.u, 1.0);
  if (L.size() == 0) return found;
  RandomTrials trials(problem);
  for (int round = 0; round < kRounds && !found.passed && !exhausted(problem, found); ++round) {
    const Eigen::VectorXd from =
        trials.best(kTrials, prelude->solution.u, L, kSteps, found.solution.u);
    if (from.size() == 0) break;
    Found other = judged(problem, minimise(problem, from), found.path);
    if (!better(other, found)) continue;
    other.strays_s = found.strays_s;
    found = std::move(other);
  }
  return found;
}

Found basin_hop(const Problem& problem, Found best, int misses) {
  if (!best.solution.usable) return best;
  constexpr double kSteps[] = {0.5, 1.0, 2.0, 4.0, 10.0};
  constexpr int kTrials = 40, kMostRounds = 12;
  RandomTrials trials(problem);
  Eigen::MatrixXd L = reach(problem, best.solution.u, best.reduced_chi2);
  for (int round = 0, missed = 0;
       round < kMostRounds && missed < misses && L.size() > 0 && !exhausted(problem, best);
       ++round) {
    const Eigen::VectorXd from = trials.best(kTrials, best.solution.u, L, kSteps, best.solution.u);
    if (from.size() == 0) break;
    Found found = judged(problem, minimise(problem, from, {.iterations = 20}), best.path);
    // A ripple of less than 1 in chi-square moves nothing by more than its error bar.
    const double gain = best.solution.chi2 - found.solution.chi2;
    missed = found.solution.usable && gain > 1.0 ? 0 : missed + 1;
    if (!better(found, best)) continue;
    found.strays_s = best.strays_s;
    best = std::move(found);
    L = reach(problem, best.solution.u, best.reduced_chi2);
  }
  return best;
}

}  // namespace trochoid::fitting
