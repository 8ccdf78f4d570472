#include "strategy.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "smoothing.hpp"

namespace trochoid::fitting {
namespace {

constexpr int kThinned = 300;  // samples an exploratory fit looks at
constexpr int kShortestWindow = 24;

int free_rows(const Problem& problem) {
  return std::max(1, problem.rows() - static_cast<int>(problem.free.size()));
}

// Losses over decades hardly show on a short window; unheld they wander off to where the equations
// are stiff. Their logarithm stays within a factor of about five of the start.
void leash(Problem& problem) {
  const Eigen::VectorXd u = problem.start();
  for (std::size_t i = 0; i < problem.free.size(); ++i) {
    const model::ParameterInfo& info = problem.predictor->parameters()[problem.free[i].index];
    const bool loss = info.role == model::ParameterInfo::Role::dynamics && info.name != "a_1_s2" &&
                      info.name != "l_m";
    if (loss && problem.free[i].transform.kind == Transform::Kind::log)
      problem.free[i].leash = data::Prior{u[static_cast<int>(i)], 1.5};
  }
}

// The problem on the first `samples` samples, thinned to about kThinned of them.
Problem windowed(const Problem& problem, int samples) {
  Problem part = problem;
  const int step = std::max(1, samples / kThinned);
  part.arcs[0] = problem.arcs[0].slice(0, samples, step);
  leash(part);
  return part;
}

Found judged(const Problem& problem, Solution solution, const std::string& path) {
  Found found{std::move(solution), path, std::numeric_limits<double>::infinity(), false};
  if (!found.solution.usable) return found;
  found.reduced_chi2 = found.solution.chi2 / free_rows(problem);
  found.passed = found.reduced_chi2 < chi2_gate(problem.rows());
  return found;
}

bool better(const Found& a, const Found& b) {
  return a.solution.usable && (!b.solution.usable || a.reduced_chi2 < b.reduced_chi2);
}

double chi2_at(const Problem& problem) {
  Eigen::VectorXd residuals;
  if (!evaluate(problem, 0, problem.start(), residuals, nullptr))
    return std::numeric_limits<double>::infinity();
  return residuals.squaredNorm();
}

// Starts of one window in the order of their chi-square there; those without a prediction drop out.
std::vector<Start> screened(const Problem& window, const Starter& starter) {
  std::vector<std::pair<double, Start>> scored;
  for (Start& start : starter(window.arcs[0])) {
    Problem trial = window;
    apply(start, trial);
    const double chi2 = chi2_at(trial);
    if (std::isfinite(chi2)) scored.emplace_back(chi2, std::move(start));
  }
  std::stable_sort(scored.begin(), scored.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<Start> starts;
  for (auto& [chi2, start] : scored) starts.push_back(std::move(start));
  return starts;
}

}  // namespace

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

double chi2_gate(int rows) {
  return 1.1 + 4.0 * std::sqrt(2.0 / std::max(1, rows));
}

Found grow(const Problem& problem, const Start& start, int first_window) {
  const int all = static_cast<int>(problem.arcs[0].t_s.size());
  Problem current = problem;
  apply(start, current);
  for (int window = std::min(first_window, all);; window = std::min(2 * window, all)) {
    Problem part = windowed(current, window);
    const Solution solution =
        solve(part, part.start(), {.iterations = 40, .function_tolerance = 1e-5});
    if (!solution.usable) return {};
    current.set_base(solution.u);
    // A window that is far from explained will not lead anywhere.
    if (window < all && solution.chi2 / free_rows(part) > 30.0 * chi2_gate(part.rows())) return {};
    if (window == all) break;
  }
  return judged(problem, solve(current, current.start()), start.path);
}

Found search(const Problem& problem, const Starter& starter) {
  const int all = static_cast<int>(problem.arcs[0].t_s.size());
  Found best;
  for (int window = all; window >= std::min(kShortestWindow, all); window /= 2) {
    const Problem part = windowed(problem, window);
    const std::vector<Start> starts = screened(part, starter);
    for (std::size_t i = 0; i < std::min<std::size_t>(3, starts.size()); ++i) {
      Found found = grow(problem, starts[i], window);
      if (better(found, best)) best = std::move(found);
      if (best.passed) return best;
    }
  }
  return best;
}

Found from_best_start(const Problem& problem, const Starter& starter) {
  const int all = static_cast<int>(problem.arcs[0].t_s.size());
  const std::vector<Start> starts = screened(windowed(problem, all), starter);
  return starts.empty() ? Found{} : grow(problem, starts.front(), all);
}

void start_top_spin(Problem& problem, int arc) {
  const int psi = problem.predictor->index_of("psi_rad");
  const int omega = problem.predictor->index_of("omega_s_rad_s");
  const ArcData& data = problem.arcs[arc];
  if (psi < 0 || omega < 0 || data.observable_index(model::Observable::psi_rad) < 0) return;
  Eigen::VectorXd values = problem.base[arc];
  values[psi] = values[omega] = 0.0;
  model::PredictRequest request;
  request.t_s = data.t_s;
  request.start_s = data.start_s;
  request.observables = {model::Observable::psi_rad};
  const model::Prediction prediction = problem.predictor->predict(values, request);
  std::vector<double> t_s, difference, rates;
  for (const Reading& reading : data.readings) {
    if (reading.channel != Channel::psi) continue;
    double d = reading.value.x() - prediction.values[reading.sample];
    // The next value lies where the latest rate takes it, not merely within half a turn.
    if (!difference.empty()) {
      const double step_s = data.t_s[reading.sample] - t_s.back();
      const double expected = difference.back() + (rates.empty() ? 0.0 : median(rates) * step_s);
      d = expected + std::remainder(d - expected, 2.0 * std::numbers::pi);
      rates.push_back((d - difference.back()) / step_s);
    }
    difference.push_back(d);
    t_s.push_back(data.t_s[reading.sample] - data.start_s);
  }
  const int n = static_cast<int>(t_s.size());
  if (n < 3) return;
  const Eigen::Map<const Eigen::VectorXd> t(t_s.data(), n), d(difference.data(), n);
  const double mean_t = t.mean();
  const double slope =
      (t.array() - mean_t).matrix().dot(d) / (t.array() - mean_t).matrix().squaredNorm();
  problem.base[arc][omega] = slope;
  problem.base[arc][psi] = d.mean() - slope * mean_t;
}

}  // namespace trochoid::fitting
