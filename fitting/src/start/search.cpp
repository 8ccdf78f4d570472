#include <algorithm>
#include <cmath>
#include <limits>

#include "observe/angles.hpp"
#include "observe/smoothing.hpp"
#include "start/strategy.hpp"
#include "trochoid/data/angle.hpp"

namespace trochoid::fitting {
namespace {

constexpr int kShortestWindow = 24, kFewestSamples = 16;

// Samples of the first window for a body on its rim. Angles say enough of it within a turn and a
// half of the node line; a start carries no further where a slow camera takes few pictures a turn.
int shortest_window(const ArcData& arc, int otherwise) {
  constexpr double kTurns = 1.5;
  constexpr int kLeast = 12;
  std::vector<double> rates_rad_s;
  const Reading* before = nullptr;
  for (const Reading& reading : arc.readings) {
    if (reading.channel != Channel::phi) continue;
    if (before != nullptr)
      rates_rad_s.push_back(std::abs(data::wrapped(reading.value.x() - before->value.x())) /
                            (arc.t_s[reading.sample] - arc.t_s[before->sample]));
    before = &reading;
  }
  const double turned = median_or_zero(std::move(rates_rad_s)) * arc.duration_s();
  if (!(turned > 0.0)) return otherwise;
  const double samples = kTurns * data::kTurn / turned * static_cast<double>(arc.t_s.size());
  return static_cast<int>(std::clamp<double>(samples, kLeast, otherwise));
}

double chi2_at(const Problem& problem) {
  Eigen::VectorXd residuals;
  if (!evaluate(problem, 0, problem.start(), residuals, nullptr))
    return std::numeric_limits<double>::infinity();
  return residuals.squaredNorm();
}

enum class StartsFrom { all, positions };

// Starts of one window in the order of their chi-square there; those without a prediction drop out,
// and so do those that are no better than knowing nothing although they come from angles: the
// window is too long for a start from its first samples.
std::vector<Start> screened(const Problem& window, const Starter& starter,
                            StartsFrom from = StartsFrom::all) {
  constexpr double kTellsSomething = 0.3;
  const bool seen = window.arcs[0].observable_index(model::Observable::phi_rad) >= 0;
  const double most = seen && from == StartsFrom::all ? kTellsSomething * null_chi2(window.arcs[0])
                                                      : std::numeric_limits<double>::max();
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

// Where starts come from integrals over the window, long windows serve best; where they are the
// state at its first sample (bodies on their rim), it has to be grown from a short one.
std::vector<int> window_sizes(const Problem& problem) {
  const int all = static_cast<int>(problem.arcs[0].t_s.size());
  const bool rolls = problem.predictor->index_of("w1_rad_s") >= 0;
  const int shortest = rolls ? shortest_window(problem.arcs[0], kShortestWindow) : kShortestWindow;
  std::vector<int> sizes;
  for (int window = all; window >= std::min(shortest, all); window /= 2) sizes.push_back(window);
  if (rolls) std::reverse(sizes.begin(), sizes.end());
  const bool seen = problem.arcs[0].observable_index(model::Observable::phi_rad) >= 0;
  // Unseen, a state at the first sample hardly ever leads straight to the last one.
  if (rolls && !seen && sizes.size() > 1) sizes.pop_back();
  return sizes;
}

}  // namespace

namespace {

// Where the angles were seen, a good solution is known by its chi-square. From positions alone a
// neighbouring valley can pass the gate as well, and where a body on its rim moves little more than
// its positions scatter only the best of all counts.
bool settles_it(const Problem& problem, const Found& best) {
  constexpr double kClear = 0.02;  // of the variance
  const bool seen = problem.arcs[0].observable_index(model::Observable::phi_rad) >= 0;
  const bool rim = problem.predictor->index_of("w1_rad_s") >= 0;
  if (seen) return best.passed;
  return surely_explained(problem, best) && !(rim && best.unexplained > kClear);
}

// The best of what starts led to, and how many of them led there.
class BestValley {
 public:
  explicit BestValley(Found best = {}) : best_(std::move(best)) {}

  void take(Found found) {
    if (!found.solution.usable) return;
    constexpr double kSameValley = 1e-3;  // of chi-square
    const double gain = best_.reduced_chi2 / found.reduced_chi2 - 1.0;
    if (!best_.solution.usable || gain > kSameValley)
      reached_ = 1;
    else if (gain > -kSameValley)
      ++reached_;
    if (better(found, best_)) best_ = std::move(found);
  }
  [[nodiscard]] const Found& best() const { return best_; }
  /// No better one is to be expected.
  [[nodiscard]] bool reached_often() const {
    constexpr int kOftenEnough = 3;
    return reached_ >= kOftenEnough;
  }

 private:
  Found best_;
  int reached_ = 0;
};

// A few quick tries: most tracks need no more.
Found search_briefly(const Problem& problem, const Starter& starter) {
  // Where the angles were seen, starts differ little and a good one is known by its result.
  const bool seen = problem.arcs[0].observable_index(model::Observable::phi_rad) >= 0;
  const bool rim = problem.predictor->index_of("w1_rad_s") >= 0;
  const std::size_t tried = seen ? 3 : 5;
  BestValley valley;
  const Found& best = valley.best();
  for (const int window : window_sizes(problem)) {
    const std::vector<Start> starts = screened(windowed(problem, window), starter);
    Valleys valleys;
    for (std::size_t i = 0; i < std::min(tried, starts.size()); ++i) {
      valley.take(grow(problem, starts[i], window, {.known = &valleys}));
      if (settles_it(problem, best) || exhausted(problem, best)) return best;
      if (seen && followed_closely(problem, best)) return best;
      // A wrong valley of a top may be reached as often, but is rarely so deep.
      constexpr double kLikely = 2.0;
      if (!rim && valley.reached_often() && explained_within(problem, best, kLikely)) return best;
    }
    if (followed_closely(problem, best)) return best;
  }
  return best;
}

// Many starts, each taken downhill on the window with the losses held; best first, and of those
// that end in the same valley one.
std::vector<Start> settled(const Problem& window, const Starter& starter, StartsFrom from) {
  constexpr std::size_t kSettled = 40;
  constexpr double kSameValley = 1e-2;  // of chi-square
  Problem plain = window;
  for (FreeParameter& parameter : plain.free) parameter.held |= is_loss(plain, parameter);
  std::vector<std::pair<double, Start>> ends;
  const std::vector<Start> starts = screened(window, starter, from);
  for (std::size_t i = 0; i < std::min(kSettled, starts.size()) && !exhausted(window, {}); ++i) {
    Problem trial = plain;
    apply(starts[i], trial);
    const Solution end =
        minimise(trial, trial.start(), {.iterations = 20, .function_tolerance = 1e-4});
    if (end.usable) ends.emplace_back(end.chi2, start_at(trial, end.u, starts[i].path));
  }
  std::stable_sort(ends.begin(), ends.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<Start> best;
  double last = -1.0;
  for (auto& [chi2, start] : ends) {
    if (chi2 > last * (1.0 + kSameValley)) best.push_back(std::move(start));
    last = chi2;
  }
  return best;
}

// From positions alone, grows many starts as long as they explain all they were grown over; then,
// if none of those passes, few of them come what may. Ends when the best valley has been reached so
// often that no better one is to be expected: it is not the model's fault alone then if it does not
// pass.
class WideSearch {
 public:
  WideSearch(const Problem& problem, Found best) : problem_(problem), valley_(std::move(best)) {}

  Found run(const Starter& starter, StartsFrom from) {
    const bool seen = problem_.arcs[0].observable_index(model::Observable::phi_rad) >= 0;
    const int all = static_cast<int>(problem_.arcs[0].t_s.size());
    const int shortest = shortest_window(problem_.arcs[0], kFewestSamples);
    for (int window = std::min(shortest, all); window <= all; window *= 2) {
      const std::vector<Start> starts = settled(windowed(problem_, window), starter, from);
      constexpr std::size_t kMany = 20, kFew = 6;
      constexpr double kExplainedAll = 1.0, kComeWhatMay = 0.0;  // of the gate
      if (!seen && grown(starts, window, kMany, kExplainedAll)) break;
      if ((seen || !best().passed) && grown(starts, window, kFew, kComeWhatMay)) break;
    }
    return best();
  }

 private:
  [[nodiscard]] const Found& best() const { return valley_.best(); }
  // Whether that was enough.
  bool grown(const std::vector<Start>& starts, int window, std::size_t most,
             double most_over_gate) {
    constexpr double kSlowly = 1.2;
    Valleys dead_ends;
    for (std::size_t i = 0; i < std::min(most, starts.size()); ++i) {
      const std::size_t known = dead_ends.size();
      Found found = grow(problem_, starts[i], window,
                         {kSlowly, most_over_gate, most_over_gate > 0.0 ? &dead_ends : nullptr});
      if (found.solution.usable) dead_ends.resize(known);
      valley_.take(std::move(found));
      if (settles_it(problem_, best()) || followed_closely(problem_, best()) ||
          valley_.reached_often() || exhausted(problem_, best()))
        return true;
    }
    return false;
  }

  const Problem& problem_;
  BestValley valley_;
};

}  // namespace

Found search(const Problem& problem, const Starter& starter, Effort effort) {
  const bool seen = problem.arcs[0].observable_index(model::Observable::phi_rad) >= 0;
  const bool rim = problem.predictor->index_of("w1_rad_s") >= 0;
  const bool slides = problem.predictor->model_name() == "sliding";
  Found best;
  // A sliding body's derivatives are dear, and few of its starts lead anywhere.
  const bool brief = seen || !slides || effort == Effort::brief;
  if (brief) best = search_briefly(problem, starter);
  if (settles_it(problem, best) || !rim || effort == Effort::brief ||
      followed_closely(problem, best) || exhausted(problem, best))
    return best;
  best = WideSearch(problem, std::move(best)).run(starter, StartsFrom::all);
  if (best.solution.usable || !seen) return best;
  // Angles that lead nowhere: starts from the positions alone.
  const Starter blind = [&](const ArcData& window) {
    return starter(window.without(Channel::phi));
  };
  return WideSearch(problem, std::move(best)).run(blind, StartsFrom::positions);
}

Found from_best_start(const Problem& problem, const Starter& starter) {
  const int all = static_cast<int>(problem.arcs[0].t_s.size());
  const std::vector<Start> starts = screened(windowed(problem, all), starter);
  return starts.empty() ? Found{} : grow(problem, starts.front(), all);
}

}  // namespace trochoid::fitting
