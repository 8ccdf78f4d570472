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
// are stiff, or take each other's place. Their logarithm stays within a few of the given value's.
void leash(Problem& problem) {
  for (FreeParameter& parameter : problem.free)
    if (parameter.transform.is_over_decades() && is_loss(problem, parameter))
      parameter.leash = data::Prior{parameter.transform.inverse(parameter.given), 1.0};
}

// The problem on the first `samples` samples, thinned to about kThinned of them.
Problem windowed(const Problem& problem, int samples) {
  Problem part = problem;
  const int step = std::max(1, samples / kThinned);
  part.arcs[0] = problem.arcs[0].slice(0, samples, step);
  leash(part);
  return part;
}

double chi2_at(const Problem& problem) {
  Eigen::VectorXd residuals;
  if (!evaluate(problem, 0, problem.start(), residuals, nullptr))
    return std::numeric_limits<double>::infinity();
  return residuals.squaredNorm();
}

// Starts of one window in the order of their chi-square there; those without a prediction drop out,
// and so do those that are no better than knowing nothing although the angles were seen: the window
// is too long for a start from its first samples.
std::vector<Start> screened(const Problem& window, const Starter& starter) {
  constexpr double kTellsSomething = 0.3;
  const bool seen = window.arcs[0].observable_index(model::Observable::phi_rad) >= 0;
  const double most =
      seen ? kTellsSomething * null_chi2(window.arcs[0]) : std::numeric_limits<double>::max();
  std::vector<std::pair<double, Start>> scored;
  for (Start& start : starter(window.arcs[0])) {
    Problem trial = window;
    apply(start, trial);
    const double chi2 = chi2_at(trial);
    if (chi2 < most) scored.emplace_back(chi2, std::move(start));
  }
  std::stable_sort(scored.begin(), scored.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<Start> starts;
  for (auto& [chi2, start] : scored) starts.push_back(std::move(start));
  return starts;
}

}  // namespace

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
    for (Eigen::VectorXd& base : problem.base)
      base[parameter.index] = at_limit ? 0.99 * parameter.transform.upper : 1e-6 * parameter.given;
  }
  return any;
}

namespace {

// To the minimum; what vanishes on the way is held, else it would take all the iterations.
Solution solve_to_the_end(Problem& problem) {
  const bool losses = std::any_of(problem.free.begin(), problem.free.end(),
                                  [&](const FreeParameter& p) { return is_loss(problem, p); });
  if (!losses) return solve(problem, problem.start());
  constexpr double kNothing = 0.1;  // of chi-square: far below one sigma of anything
  double before = std::numeric_limits<double>::infinity();
  for (int round = 0; round < 6; ++round) {
    const Solution solution = solve(problem, problem.start(), {.iterations = 15});
    const bool stands_still = before - solution.chi2 < kNothing;
    if (!solution.usable || solution.converged || stands_still) return solution;
    before = solution.chi2;
    hold_vanished(problem, solution.u);
  }
  return solve(problem, problem.start());
}

}  // namespace

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

Found grow(const Problem& problem, const Start& start, int first_window) {
  const int all = static_cast<int>(problem.arcs[0].t_s.size());
  Problem current = problem;
  apply(start, current);
  for (int window = std::min(first_window, all);; window = std::min(window + window / 2 + 8, all)) {
    Problem part = windowed(current, window);
    // The first window settles which valley it is; the next ones only follow it.
    const int iterations = window <= first_window ? 60 : 25;
    const Solution solution =
        solve(part, part.start(), {.iterations = iterations, .function_tolerance = 1e-5});
    if (!solution.usable) return {};
    part.set_base(solution.u);
    current.base = part.base;
    // A window that is far from explained will not lead anywhere.
    if (window < all && solution.chi2 / free_rows(part) > 30.0 * chi2_gate(part.rows())) return {};
    if (window == all) break;
  }
  return judged(problem, solve_to_the_end(current), start.path);
}

namespace {

// Where starts come from integrals over the window, long windows serve best; where they are the
// state at its first sample (bodies on their rim), it has to be grown from a short one.
std::vector<int> window_sizes(const Problem& problem) {
  const int all = static_cast<int>(problem.arcs[0].t_s.size());
  std::vector<int> sizes;
  for (int window = all; window >= std::min(kShortestWindow, all); window /= 2)
    sizes.push_back(window);
  if (problem.predictor->index_of("w1_rad_s") >= 0) std::reverse(sizes.begin(), sizes.end());
  return sizes;
}

}  // namespace

Found search(const Problem& problem, const Starter& starter) {
  // Where the angles were seen, starts differ little and a good one is known by its result.
  const bool seen = problem.arcs[0].observable_index(model::Observable::phi_rad) >= 0;
  const std::size_t tried = seen ? 2 : 5;
  // From positions alone a neighbouring valley can pass the gate as well: above half a standard
  // deviation of the chi-square distribution the other starts of the window get their turn.
  const double sure = 1.0 + 0.5 * std::sqrt(2.0 / std::max(1, problem.rows()));
  Found best;
  for (const int window : window_sizes(problem)) {
    const std::vector<Start> starts = screened(windowed(problem, window), starter);
    for (std::size_t i = 0; i < std::min(tried, starts.size()); ++i) {
      Found found = grow(problem, starts[i], window);
      if (better(found, best)) best = std::move(found);
      if (best.passed && (seen || best.reduced_chi2 < sure)) return best;
      if (seen && best.unexplained < kExplained) return best;
    }
    if (best.unexplained < kExplained) return best;
  }
  return best;
}

Found from_best_start(const Problem& problem, const Starter& starter) {
  const int all = static_cast<int>(problem.arcs[0].t_s.size());
  const std::vector<Start> starts = screened(windowed(problem, all), starter);
  return starts.empty() ? Found{} : grow(problem, starts.front(), all);
}

namespace {

// Measured minus predicted spin angle for psi_0 = omega_s = 0, with the times since the start.
struct SpinDifference {
  std::vector<double> t_s, angle_rad;
};

SpinDifference spin_difference(const Problem& problem, int arc, int psi, int omega) {
  const ArcData& data = problem.arcs[arc];
  Eigen::VectorXd values = problem.base[arc];
  values[psi] = 0.0;
  if (omega >= 0) values[omega] = 0.0;
  model::PredictRequest request;
  request.t_s = data.t_s;
  request.start_s = data.start_s;
  request.observables = {model::Observable::theta_rad, model::Observable::psi_rad};
  const model::Prediction prediction = problem.predictor->predict(values, request);
  SpinDifference difference;
  for (const Reading& reading : data.readings) {
    if (reading.channel != Channel::psi) continue;
    double measured = reading.value.x();
    if (data.folded && prediction.values[2 * reading.sample] > 0.5 * std::numbers::pi)
      measured = std::numbers::pi - measured;
    difference.angle_rad.push_back(measured - prediction.values[2 * reading.sample + 1]);
    difference.t_s.push_back(data.t_s[reading.sample] - data.start_s);
  }
  return difference;
}

// Continues the angles along their own rate: the next value lies where the latest rate takes it,
// not merely within half a turn. Returns slope and value at t = 0 of the line through them.
std::pair<double, double> line_through(const SpinDifference& raw) {
  std::vector<double> angle, rates;
  for (std::size_t i = 0; i < raw.t_s.size(); ++i) {
    double d = raw.angle_rad[i];
    if (i > 0) {
      const double step_s = raw.t_s[i] - raw.t_s[i - 1];
      const double expected = angle.back() + (rates.empty() ? 0.0 : median(rates) * step_s);
      d = expected + std::remainder(d - expected, 2.0 * std::numbers::pi);
      rates.push_back((d - angle.back()) / step_s);
    }
    angle.push_back(d);
  }
  const int n = static_cast<int>(angle.size());
  const Eigen::Map<const Eigen::VectorXd> t(raw.t_s.data(), n), d(angle.data(), n);
  const Eigen::VectorXd centred = t.array() - t.mean();
  const double slope = centred.dot(d) / centred.squaredNorm();
  return {slope, d.mean() - slope * t.mean()};
}

}  // namespace

void start_spin(Problem& problem, int arc) {
  const int psi = problem.predictor->index_of("psi_rad");
  const int omega = problem.predictor->index_of("omega_s_rad_s");
  if (psi < 0 || problem.arcs[arc].observable_index(model::Observable::psi_rad) < 0) return;
  const SpinDifference difference = spin_difference(problem, arc, psi, omega);
  if (difference.t_s.size() < 3) return;
  if (omega >= 0) {
    const auto [slope, offset] = line_through(difference);
    problem.base[arc][omega] = slope;
    problem.base[arc][psi] = offset;
    return;
  }
  double s = 0.0, c = 0.0;
  for (const double angle : difference.angle_rad) s += std::sin(angle), c += std::cos(angle);
  problem.base[arc][psi] = std::atan2(s, c);
}

}  // namespace trochoid::fitting
