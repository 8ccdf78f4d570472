#include "strategy.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "smoothing.hpp"

namespace trochoid::fitting {
namespace {

constexpr int kThinned = 300;  // samples an exploratory fit looks at

int free_rows(const Problem& problem) {
  return std::max(1, problem.rows() - static_cast<int>(problem.free.size()));
}

// Losses over decades hardly show on a short window; unheld they wander off to where the equations
// are stiff, or take each other's place. Their logarithm stays within a few of the given value's.
void leash(Problem& problem) {
  for (FreeParameter& parameter : problem.free)
    if (parameter.transform.is_over_decades() && is_loss(problem, parameter))
      parameter.leash = data::Prior{parameter.transform.inverse(parameter.given), 1.0};
}

}  // namespace

Problem windowed(const Problem& problem, int samples) {
  Problem part = problem;
  const int step = std::max(1, samples / kThinned);
  part.arcs[0] = problem.arcs[0].slice(0, samples, step);
  leash(part);
  return part;
}

Found judged(const Problem& problem, Solution solution, const std::string& path) {
  Found found;
  found.solution = std::move(solution);
  found.path = path;
  found.reduced_chi2 = std::numeric_limits<double>::infinity();
  if (!found.solution.usable) return found;
  found.reduced_chi2 = found.solution.chi2 / free_rows(problem);
  found.unexplained = found.solution.chi2 / std::max(null_chi2(problem.arcs[0]), 1e-300);
  found.passed = found.reduced_chi2 < chi2_gate(problem.rows());
  return found;
}

bool better(const Found& a, const Found& b) {
  return a.solution.usable && (!b.solution.usable || a.reduced_chi2 < b.reduced_chi2);
}

bool surely_explained(const Problem& problem, const Found& best) {
  return best.passed &&
         best.reduced_chi2 < 1.0 + 0.5 * std::sqrt(2.0 / std::max(1, problem.rows()));
}

bool exhausted(const Problem& problem, const Found& best) {
  // Positions alone have more valleys to look into.
  const bool seen = problem.arcs[0].observable_index(model::Observable::phi_rad) >= 0;
  constexpr double kNearly = 0.03;  // of the variance
  const double most = !seen ? 1.5e7 : best.unexplained < kNearly ? 6e6 : 1e7;
  return problem.work && *problem.work > most;
}

bool surely_found(const Problem& problem, const Found& best) {
  const bool seen = problem.arcs[0].observable_index(model::Observable::phi_rad) >= 0;
  const bool slides = problem.predictor->model_name() == "sliding";
  if (exhausted(problem, best)) return true;
  if (seen || !slides) return best.passed || best.unexplained < kExplained;
  return surely_explained(problem, best);
}

Problem for_predictor(const Problem& problem, const model::Predictor& predictor) {
  Problem other = problem;
  other.predictor = &predictor;
  other.free.clear();
  const auto& names = predictor.parameters();
  for (const FreeParameter& parameter : problem.free) {
    FreeParameter same = parameter;
    same.index = predictor.index_of(problem.predictor->parameters()[parameter.index].name);
    if (same.index >= 0) other.free.push_back(same);
  }
  for (Eigen::VectorXd& base : other.base) {
    const Eigen::VectorXd before = base;
    base.resize(static_cast<int>(names.size()));
    for (int i = 0; i < base.size(); ++i) {
      const int from = problem.predictor->index_of(names[i].name);
      base[i] = from >= 0 ? before[from] : names[i].value;
    }
  }
  return other;
}

void apply(const Start& start, Problem& problem) {
  for (const auto& [name, value] : start.values) {
    const int index = problem.predictor->index_of(name);
    if (index < 0) continue;
    for (const FreeParameter& parameter : problem.free)
      if (parameter.index == index) problem.base[std::max(0, parameter.arc)][index] = value;
  }
  // Shared parameters live in the first arc's values; keep the others in step.
  for (const FreeParameter& parameter : problem.free)
    if (parameter.arc < 0)
      for (Eigen::VectorXd& base : problem.base)
        base[parameter.index] = problem.base[0][parameter.index];
}

double null_chi2(const ArcData& arc) {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  double chi2 = 0.0;
  Eigen::RowVector2d mean = Eigen::RowVector2d::Zero();
  double tilt = 0.0;
  int tilts = 0;
  if (arc.observable_index(model::Observable::x_m) >= 0) mean = arc.positions_m().colwise().mean();
  for (const Reading& reading : arc.readings)
    if (reading.channel == Channel::theta) tilt += reading.value.x(), ++tilts;
  for (const Reading& reading : arc.readings) {
    const double weight = reading.whitener(0, 0) * reading.whitener(0, 0);
    if (reading.channel == Channel::position)
      chi2 += (reading.whitener.transpose() * (reading.value - mean.transpose())).squaredNorm();
    else if (reading.channel == Channel::theta)
      chi2 += weight * std::pow(reading.value.x() - tilt / tilts, 2);
    else
      chi2 += weight * kTurn * kTurn / 12.0;
  }
  return chi2;
}

double chi2_gate(int rows) {
  return 1.1 + 4.0 * std::sqrt(2.0 / std::max(1, rows));
}

Found grow(const Problem& problem, const Start& start, int first_window, double growth,
           std::vector<double>* valleys) {
  constexpr double kSameValley = 1e-3;  // of chi-square
  const int all = static_cast<int>(problem.arcs[0].t_s.size());
  Problem current = problem;
  apply(start, current);
  constexpr double kLost = 4.0;  // of chi-square per row: a turn was lost on the way
  constexpr int kMostRetreats = 4, kLeastStep = 4;
  int before = 0, retreats = 0;  // the window explained last
  double explained = chi2_gate(all);
  for (int window = std::min(first_window, all);;) {
    Problem part = windowed(current, window);
    // The first window settles which valley it is; the next ones only follow it.
    const bool first = before == 0;
    const Solution solution = seek(
        part, part.start(),
        {.iterations = first ? 60 : 25, .function_tolerance = first && window < all ? 1e-4 : 1e-3});
    const double reduced = solution.chi2 / free_rows(part);
    const bool lost = !solution.usable || reduced > kLost * explained;
    if (!first && lost && retreats < kMostRetreats && window - before > kLeastStep) {
      ++retreats;
      growth = 1.0 + 0.5 * (growth - 1.0);
      window = before + (window - before) / 2;
      continue;
    }
    if (!solution.usable) return {};
    part.set_base(solution.u);
    current.base = part.base;
    if (first && window < all && valleys != nullptr) {
      const bool known = std::any_of(valleys->begin(), valleys->end(), [&](double chi2) {
        return std::abs(solution.chi2 - chi2) < kSameValley * chi2;
      });
      if (known) return {};
      valleys->push_back(solution.chi2);
    }
    // A window that is far from explained will not lead anywhere.
    if (window < all && reduced > 30.0 * chi2_gate(part.rows())) {
      if (problem.shortfalls) ++problem.shortfalls->departed;
      return {};
    }
    if (problem.partial && window > problem.partial->samples && reduced < chi2_gate(part.rows()))
      *problem.partial = {window, part.base[0]};
    if (window == all) break;
    explained = std::max(reduced, chi2_gate(part.rows()));
    before = window;
    window = std::min(static_cast<int>(growth * window) + 8, all);
  }
  if (problem.rough)
    return judged(problem,
                  seek(current, current.start(), {.iterations = 20, .function_tolerance = 1e-3}),
                  start.path);
  return judged(problem, solve_to_the_end(current), start.path);
}

}  // namespace trochoid::fitting
