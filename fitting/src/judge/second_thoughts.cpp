#include "judge/second_thoughts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "judge/adequacy.hpp"
#include "judge/contradictions.hpp"
#include "judge/counting.hpp"
#include "judge/lost_pictures.hpp"
#include "judge/one_friction.hpp"

namespace trochoid::fitting {

using data::FitVerdict;

namespace {

// Positions at an end of an arc, at least half of which stand out, the last of them among those.
struct MissedEnd {
  int arc = 0;
  bool beginning = true;
  int standing_out = 0, of = 0;
  double until_s = 0.0;  // where the explained part begins or ends
};

// Whether a run of positions beside the path of the others counts: a tracker's errors, mostly, but
// so is a motion that few samples show.
enum class Glitches { left_out, counted };

MissedEnd missed_end(const std::vector<Counting>& from_the_end, Glitches glitches, int arc,
                     bool beginning) {
  MissedEnd end{.arc = arc, .beginning = beginning};
  int seen = 0, out = 0;
  for (const Counting& position : from_the_end) {
    if (position.glitch && glitches == Glitches::left_out) continue;
    ++seen;
    if (!(position.weight < 1.0)) continue;
    ++out;
    if (2 * out >= seen) end.standing_out = out, end.of = seen, end.until_s = position.t_s;
  }
  return end;
}

// The end of which most stands out.
MissedEnd worst_missed_end(const Problem& problem, const Eigen::VectorXd& u, Glitches glitches) {
  MissedEnd worst;
  for (int arc = 0; arc < static_cast<int>(problem.arcs.size()); ++arc) {
    std::vector<Counting> positions = counting(problem, arc, u);
    for (const bool beginning : {true, false}) {
      const MissedEnd end = missed_end(positions, glitches, arc, beginning);
      if (end.standing_out > worst.standing_out) worst = end;
      std::reverse(positions.begin(), positions.end());
    }
  }
  return worst;
}

// A path that was simulated: what a fit leaves of it is rounding and the errors of integration,
// which drift.
bool is_exact(const ArcData& arc) {
  constexpr double kRounding = 1e-9;
  if (!arc.sigma_unknown || arc.observables[0] != model::Observable::x_m) return false;
  const Eigen::MatrixX2d at_m = arc.positions_m();
  const double extent_m = (at_m.colwise().maxCoeff() - at_m.colwise().minCoeff()).norm();
  const double noise_m = noise_scale(arc, Channel::position) / arc.readings.front().whitener(0, 0);
  return noise_m < kRounding * extent_m;
}

void doubt_if_drifting(const Problem& problem, const Uncertainty& error, data::Fit& fit) {
  constexpr double kByChance = 1e-6, kNotWhite = 0.01;
  const Drift& drift = error.drift;
  if (std::all_of(problem.arcs.begin(), problem.arcs.end(), is_exact)) return;
  if (!says_explained(fit) || error.whiteness.p_value > kNotWhite) return;
  if (chi2_upper_tail(drift.gain * drift.parameters, drift.parameters) > kByChance) return;
  if (is_tracked(problem) && drift.gain < kOfATracker) return;
  fit.verdict = FitVerdict::doubtful;
  fit.verdict_words = fmt::format(
      "the model follows the track, but does not explain it: the second half asks for other "
      "parameters than the first (chi-square would fall by {:.2g} times its noise for each), the "
      "model lacks something, and the error bars are too small",
      drift.gain);
}

// What becomes of the state at the first sample where the model misses the samples there, and what
// may have happened to the body.
std::string what_an_end_may_be(const Problem& problem, const MissedEnd& end) {
  const bool rolls = problem.predictor->model_name() == "rolling";
  if (!end.beginning)
    return rolls ? "the body may slip or touch something there" : "it may be another motion";
  return fmt::format(
      "{}, and the state given for {:.4g} s is the model's path followed back to then, not how the "
      "body began",
      rolls ? "the body may slip before it rolls" : "it may be another motion",
      problem.arcs[end.arc].start_s);
}

// Which of several arcs: a puck's track is divided into stretches.
std::string which_of_several(const Problem& problem, const ArcData& arc) {
  const auto& arcs = problem.arcs;
  const auto of_same_track = std::count_if(
      arcs.begin(), arcs.end(), [&](const ArcData& other) { return other.track == arc.track; });
  std::string words;
  if (of_same_track > 1)
    words +=
        fmt::format(" of the stretch from {:.4g} to {:.4g} s", arc.t_s.front(), arc.t_s.back());
  if (of_same_track < std::ssize(arcs)) words += fmt::format(" of track {}", arc.track + 1);
  return words;
}

// Given up at the beginning of an arc, and nowhere else in it: no chance, even of one. A slip may
// end within a frame.
MissedEnd first_alone(const Problem& problem, const Eigen::VectorXd& u) {
  constexpr double kGivenUp = 0.1;
  constexpr std::ptrdiff_t kOthers = 50;
  const auto counts = [](const Counting& position) { return position.weight > kGivenUp; };
  for (int arc = 0; arc < static_cast<int>(problem.arcs.size()); ++arc) {
    const std::vector<Counting> positions = counting(problem, arc, u);
    const auto kept = std::find_if(positions.begin(), positions.end(), counts);
    const auto out = static_cast<int>(std::distance(positions.begin(), kept));
    if (out == 0 || std::distance(kept, positions.end()) < kOthers ||
        !std::all_of(kept, positions.end(), counts))
      continue;
    return {.arc = arc, .standing_out = out, .of = out, .until_s = (kept - 1)->t_s};
  }
  return {};
}

std::string where_it_is(const Problem& problem, const MissedEnd& end) {
  const std::string of_which = which_of_several(problem, problem.arcs[end.arc]);
  if (end.of == 1)
    return fmt::format(
        "the first position{}, at {:.4g} s, lies farther from its path than noise "
        "explains",
        of_which, end.until_s);
  return fmt::format(
      "{} of the {} {} positions{}, {} {:.4g} s, lie farther from its path than noise explains",
      end.standing_out, end.of, end.beginning ? "first" : "last", of_which,
      end.beginning ? "up to" : "from", end.until_s);
}

// Motion that the model lacks where a record begins or ends costs it little: what stands out is
// given up, and the rest may be explained. A tracker that errs for a few frames does the same, so
// of few it is told only.
void doubt_if_an_end_is_missed(const Problem& problem, const Eigen::VectorXd& u,
                               const Uncertainty& error, data::Fit& fit) {
  constexpr int kWorthWords = 3, kNoTracker = 8;
  constexpr double kIndependent = 3.0;  // one in 460 stands out by chance
  if (!says_explained(fit)) return;
  const auto too_many = [&](const MissedEnd& end) {
    const ArcData& arc = problem.arcs[end.arc];
    const double step_s =
        arc.duration_s() / std::max<double>(1.0, static_cast<double>(arc.t_s.size()) - 1.0);
    const double memory = error.whiteness.correlation_time_s / std::max(step_s, 1e-300);
    return end.standing_out >= std::max<double>(kNoTracker, kIndependent * memory);
  };
  MissedEnd end = worst_missed_end(problem, u, Glitches::left_out);
  const bool doubtful = too_many(end);
  if (!doubtful) end = worst_missed_end(problem, u, Glitches::counted);
  if (end.standing_out < kWorthWords) end = first_alone(problem, u);
  if (end.standing_out == 0) return;
  const std::string where = where_it_is(problem, end);
  const std::string what = what_an_end_may_be(problem, end);
  if (!doubtful) {
    fit.warnings.push_back(
        fmt::format("{}, and {} for less, as if the tracker had erred; if it had not, {}", where,
                    end.standing_out == 1 ? "counts" : "count", what));
    return;
  }
  fit.verdict = FitVerdict::doubtful;
  fit.verdict_words = fmt::format(
      "the model follows the track, but does not explain {} {}: {}, more than a "
      "tracker misses in a row, and count for less: {}",
      problem.arcs.size() > 1 ? "one" : "its", end.beginning ? "beginning" : "end", where, what);
}

}  // namespace

void doubt_as_a_whole(const Problem& problem, const Eigen::VectorXd& u, const Uncertainty& error,
                      const data::FitSettings& settings, data::Fit& fit) {
  doubt_if_a_track_shows_nothing(problem, u, fit);
  doubt_if_pictures_are_lost(problem, u, error, fit);
  // A body that slips at first makes the halves differ, too: that it slips says more.
  doubt_if_an_end_is_missed(problem, u, error, fit);
  doubt_if_drifting(problem, error, fit);
  doubt_if_priors_contradict(problem, u, error, fit);
  doubt_if_fixed_contradict(problem, u, settings, fit);
  doubt_if_bounds_contradict(problem, u, error, settings, fit);
  doubt_if_tracks_differ(problem, u, error, fit);
  doubt_if_frictions_differ(problem, fit);
}

}  // namespace trochoid::fitting
