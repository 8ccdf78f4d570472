#include <algorithm>
#include <cmath>
#include <limits>

#include "observe/decompositions.hpp"
#include "start/strategy.hpp"

// Losses are fitted by their logarithm, where nothing pulls one that has vanished back.
namespace trochoid::fitting {

bool hold_vanished(Problem& problem, const Eigen::VectorXd& u) {
  constexpr double kUnseen = 0.05;  // change of all residuals together, in sigma, if it doubled
  problem.set_base(u);
  const int count = static_cast<int>(problem.free.size());
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(count);
  for (int arc = 0; arc < static_cast<int>(problem.arcs.size()); ++arc) {
    Eigen::VectorXd residuals;
    Eigen::MatrixXd jacobian;
    if (!evaluate(problem, arc, problem.start(), residuals, &jacobian)) return false;
    const std::vector<int> columns = problem.columns_of(arc);
    for (std::size_t c = 0; c < columns.size(); ++c)
      squares[columns[c]] += jacobian.col(static_cast<int>(c)).squaredNorm();
  }
  bool any = false;
  for (int i = 0; i < count; ++i) {
    FreeParameter& parameter = problem.free[i];
    if (!parameter.transform.is_over_decades() || parameter.held) continue;
    const double value = problem.base[std::max(0, parameter.arc)][parameter.index];
    const bool vanished = value < 1e-2 * parameter.given && std::sqrt(squares[i]) < kUnseen;
    const bool at_limit = parameter.transform.kind == Transform::Kind::limited &&
                          value > 0.99 * parameter.transform.upper;
    if (!vanished && !at_limit) continue;
    parameter.held = any = true;
    double at = 0.99 * parameter.transform.upper;
    if (!at_limit) {
      // Of a first value far beyond what acts a millionth may be seen.
      at = 1e-6 * parameter.given;
      const double effect = value > 0.0 ? std::sqrt(squares[i]) * at / value : 0.0;
      if (effect > kUnseen) at *= kUnseen / effect;
    }
    for (Eigen::VectorXd& base : problem.base) base[parameter.index] = at;
  }
  return any;
}

namespace {

// What is left of chi-square below that moves nothing by a tenth of its error bar: the weights
// change afterwards by more, and the polish goes on from there.
constexpr double kNear = 1e-5;

// To the minimum; what vanishes on the way is held, else it would take all the iterations.
Solution descend(Problem& problem) {
  const bool losses = std::any_of(problem.free.begin(), problem.free.end(),
                                  [&](const FreeParameter& p) { return is_loss(problem, p); });
  if (!losses) return minimise(problem, problem.start(), {.function_tolerance = kNear});
  // Far below one sigma of anything, also where residuals are larger than the noise.
  const auto nothing = [](double chi2) { return std::max(0.1, 1e-4 * chi2); };
  double before = std::numeric_limits<double>::infinity();
  for (int round = 0; round < 6; ++round) {
    const Solution solution =
        minimise(problem, problem.start(), {.iterations = 15, .function_tolerance = kNear});
    const bool stands_still = before - solution.chi2 < nothing(solution.chi2);
    if (!solution.usable || solution.converged || stands_still) return solution;
    before = solution.chi2;
    hold_vanished(problem, solution.u);
  }
  return minimise(problem, problem.start(), {.function_tolerance = kNear});
}

// A vanished loss, what it would do, and what the others would do beside it.
struct Probe {
  int free = 0;
  double value = 0.0;  ///< at which chi-square, linearised, is least
  double gain = 0.0;   ///< of chi-square
  std::vector<int> others;
  Eigen::VectorXd step;  ///< of the others
};

// Score test: each of the vanished losses, which act in proportion, is varied together with all
// that is not held. The most rewarding one, gain 0 if there is none.
Probe most_missed(const Problem& problem, const std::vector<int>& vanished) {
  Eigen::VectorXd r;
  Eigen::MatrixXd j;
  Probe best;
  if (!evaluate(problem, 0, problem.start(), r, &j)) return best;
  std::vector<int> others;
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i)
    if (!problem.free[i].held && std::find(vanished.begin(), vanished.end(), i) == vanished.end())
      others.push_back(i);
  const Eigen::MatrixXd active = j(Eigen::all, others);
  const LeastSquares by_others(active);
  for (const int i : vanished) {
    // The derivative by the logarithm is what as much again does.
    const Eigen::VectorXd alone = j.col(i) - active * by_others.solve(j.col(i));
    const double size2 = alone.squaredNorm();
    const double times = size2 > 0.0 ? -r.dot(alone) / size2 : 0.0;
    const double gain = times * times * size2;
    if (times > 0.0 && gain > best.gain)
      best = {i, problem.base[0][problem.free[i].index] * (1.0 + times), gain, others,
              by_others.solve(-r - times * j.col(i))};
  }
  return best;
}

// Lets a missed loss act, and the others with it, as far as that holds what it promises. False:
// not at all.
bool release_loss(const Problem& problem, const Probe& probe, double chi2, Problem& trial) {
  constexpr double kMostWorse = 2.0, kMostTimes = 10.0, kLeastShare = 0.01;
  const FreeParameter& gone = problem.free[probe.free];
  const double whole = std::min(1.0, kMostTimes * gone.given / probe.value);
  for (double share = whole; share > kLeastShare * whole; share *= 0.25) {
    trial = problem;
    FreeParameter& missed = trial.free[probe.free];
    missed.held = false;
    Eigen::VectorXd u = problem.start();
    u(probe.others) += share * probe.step;
    u[probe.free] = missed.transform.inverse(share * probe.value);
    Eigen::VectorXd r;
    if (!evaluate(trial, 0, u, r, nullptr) || r.squaredNorm() > kMostWorse * chi2) continue;
    trial.set_base(u);
    return true;
  }
  return false;
}

// Free parameters that are losses and next to nothing.
std::vector<int> vanished_losses(const Problem& problem) {
  constexpr double kNothing = 1e-2;  // of the given value
  std::vector<int> vanished;
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i) {
    const FreeParameter& parameter = problem.free[i];
    if (parameter.transform.is_over_decades() && is_loss(problem, parameter) &&
        problem.base[0][parameter.index] < kNothing * parameter.given)
      vanished.push_back(i);
  }
  return vanished;
}

}  // namespace

bool has_vanished(const Problem& problem, const Eigen::VectorXd& u) {
  Problem at = problem;
  at.set_base(u);
  return !vanished_losses(at).empty();
}

Solution solve_to_the_end(Problem& problem) {
  constexpr double kWorth = 2.0;  // of chi-square
  Solution best = descend(problem);
  const int rounds = static_cast<int>(problem.free.size());
  for (int round = 0; round < rounds && best.usable; ++round) {
    problem.set_base(best.u);
    const std::vector<int> vanished = vanished_losses(problem);
    const Probe probe = vanished.empty() ? Probe{} : most_missed(problem, vanished);
    if (probe.gain < kWorth) break;
    Problem trial;
    if (!release_loss(problem, probe, best.chi2, trial)) break;
    Solution again = descend(trial);
    if (!again.usable || again.chi2 > best.chi2 - 0.1) break;
    best = std::move(again);
    problem = std::move(trial);
  }
  return best;
}

}  // namespace trochoid::fitting
