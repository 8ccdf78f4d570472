#include "start/strategy.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "observe/direction.hpp"
#include "trochoid/data/angle.hpp"

namespace trochoid::fitting {
namespace {

constexpr int kThinned = 300;  // samples an exploratory fit looks at

// Losses over decades hardly show on a short window; unheld they wander off to where the equations
// are stiff, or take each other's place. Their logarithm stays within a few of the given value's.
void add_soft_priors(Problem& problem) {
  for (FreeParameter& parameter : problem.free) {
    const std::string& name = problem.predictor->parameters()[parameter.index].name;
    if ((parameter.transform.is_over_decades() && is_loss(problem, parameter)) ||
        name == kSlipScale)
      parameter.soft_prior = data::Prior{parameter.transform.inverse(parameter.given), 1.0};
  }
}

}  // namespace

int free_rows(const Problem& problem) {
  return std::max(1, problem.rows() - static_cast<int>(problem.free.size()));
}

Problem windowed(const Problem& problem, int samples) {
  Problem part = problem;
  const int step = std::max(1, samples / kThinned);
  part.arcs[0] = problem.arcs[0].slice(0, samples, step);
  add_soft_priors(part);
  return part;
}

Problem without_samples(const Problem& problem, const std::vector<double>& t_s) {
  Problem part = problem;
  const std::vector<double>& all_s = problem.arcs[0].t_s;
  std::vector<int> kept;
  for (int i = 0; i < static_cast<int>(all_s.size()); ++i)
    if (std::find(t_s.begin(), t_s.end(), all_s[i]) == t_s.end()) kept.push_back(i);
  part.arcs[0] = problem.arcs[0].keep(kept);
  return part;
}

namespace {

// A top that nods more than half a turn between two samples has slower twins, which look the same
// at evenly spaced times.
bool nods_between_samples(const Problem& problem, const Eigen::VectorXd& u) {
  const model::Predictor& predictor = *problem.predictor;
  if (!predictor.model_name().starts_with("top")) return false;
  const Eigen::VectorXd values = problem.values(0, u);
  const auto value = [&](const char* name) { return values[predictor.index_of(name)]; };
  const double rate_rad_s =
      std::abs(value("b_1_s") - 2.0 * value("dphi_rad_s") * std::cos(value("theta_rad")));
  const ArcData& arc = problem.arcs[0];
  const double gaps = std::max(1.0, static_cast<double>(arc.t_s.size()) - 1.0);
  return rate_rad_s * arc.duration_s() > data::kPi * gaps;
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
  // A top that nods between two samples is believed only where no slower one is as good, after all
  // of the search.
  constexpr double kUnlikely = 2.0;
  if (nods_between_samples(problem, found.solution.u)) {
    found.reduced_chi2 *= kUnlikely;
    found.passed = false;
  }
  return found;
}

bool better(const Found& a, const Found& b) {
  return a.solution.usable && (!b.solution.usable || a.reduced_chi2 < b.reduced_chi2);
}

bool explained_within(const Problem& problem, const Found& best, double deviations) {
  return best.passed &&
         best.reduced_chi2 < 1.0 + deviations * std::sqrt(2.0 / std::max(1, problem.rows()));
}

bool surely_explained(const Problem& problem, const Found& best) {
  constexpr double kSure_deviations = 0.5;
  return explained_within(problem, best, kSure_deviations);
}

bool exhausted(const Problem& problem, const Found& best) {
  // Positions alone have more valleys to look into.
  const bool seen = problem.arcs[0].observable_index(model::Observable::phi_rad) >= 0;
  constexpr double kNearly = 0.03;  // of the variance
  const double most = !seen ? 1.5e7 : best.unexplained < kNearly ? 6e6 : 1e7;
  return problem.work && *problem.work > most;
}

bool followed_closely(const Problem& problem, const Found& best) {
  constexpr double kExplained = 1e-4;  // of the variance
  constexpr double kDoubtful = 4.0;    // of the stated noise's variance
  const ArcData& arc = problem.arcs[0];
  const bool stated = !arc.filmed && !arc.sigma_unknown;
  return best.unexplained < kExplained && (!stated || best.reduced_chi2 < kDoubtful);
}

bool surely_found(const Problem& problem, const Found& best) {
  const bool seen = problem.arcs[0].observable_index(model::Observable::phi_rad) >= 0;
  const bool slides = problem.predictor->model_name() == "sliding";
  if (exhausted(problem, best)) return true;
  if (seen || !slides) return best.passed || followed_closely(problem, best);
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

Start start_at(const Problem& problem, const Eigen::VectorXd& u, const std::string& path) {
  Problem at = problem;
  at.set_base(u);
  Start start{path, {}};
  for (const FreeParameter& parameter : at.free)
    start.values[problem.predictor->parameters()[parameter.index].name] =
        at.base[0][parameter.index];
  return start;
}

namespace {

// Mean over all predicted precessions of what a direction differs by from one with that tilt.
double null_chi2(const Reading& tilt, const Reading& precession, double typical_rad, bool folded) {
  constexpr int kAround = 8;
  const Eigen::Vector2d weights = weights_of_direction(tilt, precession);
  double chi2 = 0.0;
  for (int i = 0; i < kAround; ++i) {
    const double phi = precession.value.x() + data::kTurn * i / kAround;
    const Departure off =
        departure({tilt.value.x(), precession.value.x()}, {typical_rad, phi}, folded);
    chi2 += weights.cwiseProduct(off.way).squaredNorm() / kAround;
  }
  return chi2;
}

}  // namespace

double null_chi2(const ArcData& arc) {
  double chi2 = 0.0;
  Eigen::RowVector2d mean = Eigen::RowVector2d::Zero();
  double tilt = 0.0;
  int tilts = 0;
  if (arc.observable_index(model::Observable::x_m) >= 0) mean = arc.positions_m().colwise().mean();
  for (const Reading& reading : arc.readings)
    if (reading.channel == Channel::theta) tilt += reading.value.x(), ++tilts;
  for (std::size_t i = 0; i < arc.readings.size(); ++i) {
    const Reading& reading = arc.readings[i];
    const double weight = reading.whitener(0, 0) * reading.whitener(0, 0);
    if (shows_direction(arc, i))
      chi2 += null_chi2(reading, arc.readings[++i], tilt / tilts, arc.folded);
    else if (reading.channel == Channel::position)
      chi2 += (reading.whitener.transpose() * (reading.value - mean.transpose())).squaredNorm();
    else if (reading.channel == Channel::theta)
      chi2 += weight * std::pow(reading.value.x() - tilt / tilts, 2);
    else
      chi2 += weight * data::kTurn * data::kTurn / 12.0;
  }
  return chi2;
}

double chi2_gate(int rows) {
  return 1.1 + 4.0 * std::sqrt(2.0 / std::max(1, rows));
}

namespace {

// The sample of a window that alone leaves a good part of what is unexplained, -1 if there is none:
// a wrong one among the others. The last ones of a window may only be ahead of the model.
int stray_sample(const Problem& part, const Eigen::VectorXd& u) {
  constexpr double kAlone = 0.3, kFar2 = 50.0;
  constexpr int kLast = 2;
  const ArcData& arc = part.arcs[0];
  Eigen::VectorXd residuals;
  if (!evaluate(part, 0, u, residuals, nullptr)) return -1;
  std::vector<double> squares(arc.t_s.size(), 0.0);
  for (const Reading& reading : arc.readings)
    squares[reading.sample] +=
        residuals.segment(reading.row, rows_of(reading.channel)).squaredNorm();
  const auto worst = std::max_element(squares.begin(), squares.end());
  const bool alone = *worst > std::max(kFar2, kAlone * residuals.squaredNorm());
  return alone && squares.end() - worst > kLast ? static_cast<int>(worst - squares.begin()) : -1;
}

// Leaves out of `current` the samples that stray from what its first `window` ones say otherwise,
// and takes the solution of the window without them. Returns that.
Solution without_strays(Problem& current, int& window, Solution solution,
                        const SolveOptions& options, std::vector<double>& strays_s) {
  constexpr int kMost = 8;
  const int most = std::min(kMost, window / 8);
  for (int left_out = 0; left_out < most && solution.usable; ++left_out) {
    const Problem part = windowed(current, window);
    if (solution.chi2 < chi2_gate(part.rows()) * free_rows(part)) break;
    const int stray = stray_sample(part, solution.u);
    if (stray < 0) break;
    strays_s.push_back(part.arcs[0].t_s[stray]);
    current = without_samples(current, {strays_s.back()});
    --window;
    solution = minimise(windowed(current, window), solution.u, options);
  }
  return solution;
}

// Whether no start before ended there; remembers it.
bool is_new(Valleys& valleys, int window, double chi2) {
  constexpr double kSameValley = 1e-3;  // of chi-square
  const bool known = std::any_of(valleys.begin(), valleys.end(), [&](const auto& valley) {
    return valley.first == window && std::abs(valley.second - chi2) < kSameValley * chi2;
  });
  if (!known) valleys.emplace_back(window, chi2);
  return !known;
}

}  // namespace

Found grow(const Problem& problem, const Start& start, int first_window, const Growth& growth) {
  int all = static_cast<int>(problem.arcs[0].t_s.size());
  Problem current = problem;
  apply(start, current);
  constexpr double kLost = 4.0;  // of chi-square per row: a turn was lost on the way
  constexpr int kMostRetreats = 4, kLeastStep = 4;
  constexpr double kFarFromExplained = 30.0;  // times the gate
  constexpr double kTellsNothing = 0.3;       // of the variance
  const bool gated = growth.most_over_gate > 0.0;
  double rate = growth.rate;
  int before = 0, retreats = 0;  // the window explained last
  std::vector<double> strays_s;
  double explained = chi2_gate(all);
  for (int window = std::min(first_window, all);;) {
    Problem part = windowed(current, window);
    // The first window settles which valley it is; the next ones only follow it.
    const bool first = before == 0;
    const SolveOptions options{.iterations = first ? 60 : 25,
                               .function_tolerance = first && window < all ? 1e-4 : 1e-3};
    const Solution solution =
        without_strays(current, window, minimise(part, part.start(), options), options, strays_s);
    part = windowed(current, window);
    all = static_cast<int>(current.arcs[0].t_s.size());
    const double reduced = solution.chi2 / free_rows(part);
    const double gate = chi2_gate(part.rows());
    const bool lost =
        !solution.usable || reduced > (gated ? growth.most_over_gate * gate : kLost * explained);
    if (!first && lost && retreats < kMostRetreats && window - before > kLeastStep) {
      ++retreats;
      rate = 1.0 + 0.5 * (rate - 1.0);
      window = before + (window - before) / 2;
      continue;
    }
    if (!solution.usable) return {};
    part.set_base(solution.u);
    current.base = part.base;
    const bool looked_up = growth.known != nullptr && (first || gated);
    if (window < all && looked_up && !is_new(*growth.known, window, solution.chi2)) return {};
    // A window that is far from explained will not lead anywhere.
    if (window < all && (gated ? lost : reduced > kFarFromExplained * gate)) {
      if (problem.shortfalls) ++problem.shortfalls->departed;
      return {};
    }
    if (problem.partial && window > problem.partial->samples && reduced < gate)
      *problem.partial = {window, part.arcs[0].t_s.back(), part.base[0]};
    if (window == all) {
      // To the end of a valley whose floor is that high it is far, and leads nowhere.
      if (!problem.rough && solution.chi2 > kTellsNothing * null_chi2(part.arcs[0])) {
        Found found = judged(current, solution, start.path);
        found.strays_s = std::move(strays_s);
        return found;
      }
      break;
    }
    explained = std::max(reduced, gate);
    before = window;
    window = std::min(static_cast<int>(rate * window) + 8, all);
  }
  Solution solution = problem.rough ? minimise(current, current.start(),
                                               {.iterations = 20, .function_tolerance = 1e-3})
                                    : solve_to_the_end(current);
  Found found = judged(current, std::move(solution), start.path);
  found.strays_s = std::move(strays_s);
  return restart_around_fall(current, std::move(found));
}

}  // namespace trochoid::fitting
