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
// are stiff, or take each other's place. Their logarithm stays within a few of the given value's,
// and a floor within a degree of the given slope.
void add_soft_priors(Problem& problem) {
  for (FreeParameter& parameter : problem.free) {
    const std::string& name = problem.predictor->parameters()[parameter.index].name;
    if ((parameter.transform.is_over_decades() && is_loss(problem, parameter)) ||
        name == kSlipScale)
      parameter.soft_prior = data::Prior{parameter.transform.inverse(parameter.given), 1.0};
    if (!is_slope(name)) continue;
    const double given = parameter.transform.inverse(parameter.given);
    parameter.soft_prior =
        data::Prior{given, data::radians(1.0) / parameter.transform.slope(given)};
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

// A start followed from window to window of the record.
class Follower {
 public:
  Follower(const Problem& problem, const Start& start, int first_window, const Growth& growth)
      : problem_(problem),
        growth_(growth),
        current_(problem),
        all_(samples()),
        window_(std::min(first_window, all_)),
        rate_(growth.rate),
        explained_(chi2_gate(all_)) {
    apply(start, current_);
  }

  // As far as the start leads; whether to the end of the record.
  bool follow() {
    for (;;) switch (step()) {
        case Step::led_nowhere:
          return false;
        case Step::at_the_end:
          return true;
        case Step::on:
          break;
      }
  }

  // Of a start that led to the end.
  [[nodiscard]] Found found(const std::string& path) {
    // To the end of a valley whose floor is that high it is far, and leads nowhere.
    constexpr double kTellsNothing = 0.3;  // of the variance
    const bool high = !problem_.rough &&
                      last_.chi2 > kTellsNothing * null_chi2(windowed(current_, window_).arcs[0]);
    if (!high)
      last_ = problem_.rough ? minimise(current_, current_.start(),
                                        {.iterations = 20, .function_tolerance = 1e-3})
                             : solve_to_the_end(current_);
    Found found = judged(current_, std::move(last_), path);
    found.strays_s = std::move(strays_s_);
    return high ? found : restart_around_fall(current_, std::move(found));
  }

 private:
  enum class Step { on, at_the_end, led_nowhere };

  [[nodiscard]] int samples() const { return static_cast<int>(current_.arcs[0].t_s.size()); }

  // The path in the present window, and what that means.
  Step step() {
    // The first window settles which valley it is; the next ones only follow it.
    const bool first = before_ == 0;
    const SolveOptions options{.iterations = first ? 60 : 25,
                               .function_tolerance = first && window_ < all_ ? 1e-4 : 1e-3};
    Problem part = windowed(current_, window_);
    last_ = without_strays(current_, window_, minimise(part, part.start(), options), options,
                           strays_s_);
    part = windowed(current_, window_);
    all_ = samples();
    const double reduced = last_.chi2 / free_rows(part), gate = chi2_gate(part.rows());
    const bool lost = loses(reduced, gate);
    if (!first && lost && retreats()) return Step::on;
    if (!last_.usable) return Step::led_nowhere;
    part.set_base(last_.u);
    current_.base = part.base;
    const bool gated = growth_.most_over_gate > 0.0;
    const bool looked_up = growth_.known != nullptr && (first || gated);
    if (window_ < all_ && looked_up && !is_new(*growth_.known, window_, last_.chi2))
      return Step::led_nowhere;
    // A window that is far from explained will not lead anywhere.
    constexpr double kFarFromExplained = 30.0;  // times the gate
    if (window_ < all_ && (gated ? lost : reduced > kFarFromExplained * gate)) {
      if (problem_.shortfalls) ++problem_.shortfalls->departed;
      return Step::led_nowhere;
    }
    if (problem_.partial && window_ > problem_.partial->samples && reduced < gate)
      *problem_.partial = {window_, part.arcs[0].t_s.back(), part.base[0]};
    if (window_ == all_) return Step::at_the_end;
    explained_ = std::max(reduced, gate);
    before_ = window_;
    window_ = std::min(static_cast<int>(rate_ * window_) + 8, all_);
    return Step::on;
  }

  // Whether a turn was lost on the way to so much chi-square a row.
  [[nodiscard]] bool loses(double reduced, double gate) const {
    constexpr double kLost = 4.0;
    const double most =
        growth_.most_over_gate > 0.0 ? growth_.most_over_gate * gate : kLost * explained_;
    return !last_.usable || reduced > most;
  }

  // Half the way from what was explained last; false where that is tried or little.
  bool retreats() {
    constexpr int kMostRetreats = 4, kLeastStep = 4;
    if (retreats_ >= kMostRetreats || window_ - before_ <= kLeastStep) return false;
    ++retreats_;
    rate_ = 1.0 + 0.5 * (rate_ - 1.0);
    window_ = before_ + (window_ - before_) / 2;
    return true;
  }

  const Problem& problem_;
  const Growth& growth_;
  Problem current_;
  int all_, window_;
  int before_ = 0, retreats_ = 0;  // the window explained last
  double rate_, explained_;
  Solution last_;
  std::vector<double> strays_s_;
};

}  // namespace

Found grow(const Problem& problem, const Start& start, int first_window, const Growth& growth) {
  Follower follower(problem, start, first_window, growth);
  return follower.follow() ? follower.found(start.path) : Found{};
}

}  // namespace trochoid::fitting
