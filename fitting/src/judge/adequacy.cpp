#include "judge/adequacy.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "judge/counting.hpp"
#include "observe/decompositions.hpp"
#include "observe/smoothing.hpp"
#include "start/strategy.hpp"

namespace trochoid::fitting {

using data::FitOutcome, data::FitVerdict;

namespace {

// Where the prediction, which has no noise, scatters about a smooth curve as the samples do, frames
// are too few to tell noise from motion.
constexpr double kMostlyMotion = 0.5;

}  // namespace

Squares squares(const Problem& problem, const Solution& solution) {
  Squares sum;
  for (int arc = 0; arc < static_cast<int>(problem.arcs.size()); ++arc) {
    const ArcData& data = problem.arcs[arc];
    if (data.observable_index(model::Observable::x_m) < 0) continue;
    const Problem plain = in_stated_sigmas(problem, Weights::kept);
    Eigen::VectorXd r;
    if (!evaluate(plain, arc, solution.u, r, nullptr)) return {.ok = false};
    const Eigen::MatrixX2d xy = data.positions_m();
    const Eigen::RowVector2d mean = xy.colwise().mean();
    const double noise_m = noise_about_smooth_curve(data.t_s, xy);
    const auto predicted_noise_m = [&] {
      const Eigen::VectorXd plainly = plain_residuals(problem, arc, solution.u);
      return plainly.size() > 0 ? noise_about_smooth_curve(data.t_s, predicted_m(data, plainly))
                                : 0.0;
    };
    const bool motion = !data.sigma_unknown && (std::ssize(data.t_s) < kFewestForNoise ||
                                                predicted_noise_m() > kMostlyMotion * noise_m);
    for (const Reading& reading : data.readings) {
      if (reading.channel != Channel::position) continue;
      const Eigen::Matrix2d wt = reading.whitener.transpose();
      sum.residual += r.segment<2>(reading.row).squaredNorm();
      sum.motion += (wt * (reading.value - mean.transpose())).squaredNorm();
      const double scatter = wt.squaredNorm() * noise_m * noise_m;
      sum.scatter += motion ? std::min(scatter, 2.0 * kMisjudged * kMisjudged) : scatter;
    }
  }
  return sum;
}

namespace {

constexpr double kHopeless = 4.0;  // times the noise: far beyond what a tracker misjudges
constexpr double kDoubtful = 2.0;
constexpr const char* kChannelWords[] = {"positions", "tilt", "azimuth", "spin angle"};

// A quiet minimiser in the wrong valley: the residuals carry a good part of the motion although the
// samples scatter far less about a smooth curve.
bool explains_path(const Squares& sum) {
  return sum.ok && (sum.residual <= 0.03 * sum.motion || sum.residual <= 4.0 * sum.scatter);
}

struct Misfit {
  double times = 0.0;  // residuals over noise
  Channel channel = Channel::position;
  int track = -1;  // of several

  [[nodiscard]] std::string words() const {
    const std::string what = kChannelWords[static_cast<int>(channel)];
    return track < 0 ? "its " + what : fmt::format("track {}'s {}", track + 1, what);
  }
};

bool seen(const Problem& problem, Channel channel) {
  return std::any_of(problem.arcs.begin(), problem.arcs.end(), [&](const ArcData& arc) {
    return std::any_of(arc.readings.begin(), arc.readings.end(),
                       [&](const Reading& reading) { return reading.channel == channel; });
  });
}

double typical_noise(const Problem& problem, Channel channel) {
  std::vector<double> sigmas;
  for (const ArcData& arc : problem.arcs)
    for (const Reading& reading : arc.readings)
      if (reading.channel == channel)
        sigmas.push_back(noise_scale(arc, channel) / reading.whitener(0, 0));
  return median_or_zero(std::move(sigmas));
}

// What a channel's residuals are in one track, over its sigmas or the scatter of its samples.
double times_noise(const Problem& problem, int track, Channel channel) {
  constexpr double kFine = 1.04;  // nobody asks whether the samples scatter as much
  double noise = 0.0, scatter = 1.0;
  for (const ArcData& arc : problem.arcs) {
    if (arc.track != track) continue;
    noise = std::max(noise, noise_scale(arc, channel));
    if (noise_scale(arc, channel) > kFine)
      scatter = std::max(scatter, excess_scatter(arc, channel));
  }
  return noise / scatter;
}

// Of the worst channel and track. A path that is followed is doubtful at most: trackers know little
// of their common errors. The noise is the larger one of the track's own sigmas and the scatter of
// its samples about a smooth curve.
Misfit misfit(const Problem& problem, const Squares& sum) {
  constexpr double kFollowed_rad = 0.2;
  // Within 1 % of the motion, and not so far off that only the model can be to blame.
  constexpr double kFollowed = 1e-4, kAnyTracker = 8.0;
  int rows = 0;
  for (const ArcData& arc : problem.arcs)
    for (const Reading& reading : arc.readings)
      rows += reading.channel == Channel::position ? 2 : 0;
  const double path = std::sqrt(sum.residual / std::max(1.0, std::max<double>(rows, sum.scatter)));
  const bool path_followed =
      is_tracked(problem) && sum.ok && path < kAnyTracker && sum.residual < kFollowed * sum.motion;
  std::set<int> tracks;
  for (const ArcData& arc : problem.arcs) tracks.insert(arc.track);
  Misfit worst;
  for (int c = 0; c < kChannels; ++c) {
    const auto channel = static_cast<Channel>(c);
    double times = 0.0;
    int track = -1;
    for (const int each : tracks)
      if (const double of_it = times_noise(problem, each, channel); of_it > times)
        times = of_it, track = tracks.size() > 1 ? each : -1;
    if (channel == Channel::position && path_followed) times = std::min(times, kHopeless);
    // Where the angle is all there is, being followed is not enough.
    const bool whole = problem.predictor->model_name() == "pivot" && times >= kAnyTracker;
    if (channel != Channel::position && !whole && typical_noise(problem, channel) < kFollowed_rad)
      continue;
    if (seen(problem, channel) && times > worst.times) worst = {times, channel, track};
  }
  if (sum.ok && !path_followed && path > worst.times) worst = {path, Channel::position, -1};
  return worst;
}

int positions_in(const Problem& problem) {
  int count = 0;
  for (const ArcData& arc : problem.arcs)
    count += static_cast<int>(
        std::count_if(arc.readings.begin(), arc.readings.end(),
                      [](const Reading& reading) { return reading.channel == Channel::position; }));
  return count;
}

bool several_tracks(const Problem& problem) {
  return problem.arcs.front().track != problem.arcs.back().track;
}

// Positions the fit has given up although they lie on one path with the others: not the tracker's
// glitches, but motion that the model does not have.
struct GivenUp {
  int samples = 0, of = 0;
  double first_s = std::numeric_limits<double>::infinity(), last_s = -first_s;
  std::set<int> tracks;  // of several
  // One or two may be glitches that happen to lie near the path.
  [[nodiscard]] bool more_than(double share) const {
    constexpr int kFewest = 3;
    return samples >= kFewest && samples > share * of;
  }
  [[nodiscard]] std::string words() const {
    std::vector<int> numbers;
    for (const int track : tracks) numbers.push_back(track + 1);
    const std::string whose = numbers.empty()
                                  ? ""
                                  : fmt::format(" of track{} {}", numbers.size() > 1 ? "s" : "",
                                                fmt::join(numbers, ", "));
    return fmt::format(
        "{} of its {} positions,{} between {:.4g} and {:.4g} s, lie on one path with the others, "
        "but so far from the model's that they were left out of the fit",
        samples, of, whose, first_s, last_s);
  }
};

GivenUp given_up(const Problem& problem, const Solution& solution) {
  constexpr double kHardlyCounts = 0.1;  // beyond 11 times the noise
  GivenUp all;
  for (int arc = 0; arc < static_cast<int>(problem.arcs.size()); ++arc)
    for (const Counting& position : counting(problem, arc, solution.u)) {
      if (position.glitch || position.weight > kHardlyCounts) continue;
      ++all.samples;
      if (several_tracks(problem)) all.tracks.insert(problem.arcs[arc].track);
      all.first_s = std::min(all.first_s, position.t_s);
      all.last_s = std::max(all.last_s, position.t_s);
    }
  all.of = positions_in(problem);
  return all;
}

// Chi-square of the positions about a polynomial in time, weighted as in the fit.
double polynomial_chi2(const Problem& problem, int arc, int degree) {
  const ArcData& data = problem.arcs[arc];
  std::vector<const Reading*> readings;
  for (const Reading& reading : data.readings)
    if (reading.channel == Channel::position) readings.push_back(&reading);
  const auto n = static_cast<Eigen::Index>(readings.size());
  const double duration_s = std::max(data.duration_s(), 1e-300);
  Eigen::MatrixXd basis(2 * n, 2 * (degree + 1));
  Eigen::VectorXd right(2 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Reading& reading = *readings[i];
    const double weight =
        robust_weight(problem, arc, reading) / noise_scale(data, Channel::position);
    const Eigen::Matrix2d wt = weight * reading.whitener.transpose();
    const double t = 2.0 * (data.t_s[reading.sample] - data.t_s.front()) / duration_s - 1.0;
    double power = 1.0;
    for (int k = 0; k <= degree; ++k, power *= t) basis.block<2, 2>(2 * i, 2 * k) = power * wt;
    right.segment<2>(2 * i) = wt * reading.value;
  }
  const Eigen::VectorXd c = LeastSquares(basis).solve(right);
  constexpr double kRounding = 1e-13;
  const double left = (right - basis * c).norm();
  return left > kRounding * right.norm() ? left * left : 0.0;
}

// The least degree of polynomials that explain the positions as well as the model does, by BIC; -1
// if none, or where position is not what carries the model.
// @param of_track  alone, whose own parameters count: what it shares the others tell; -1: of all.
int sufficient_polynomial(const Problem& problem, const Eigen::VectorXd& u, int of_track = -1) {
  const std::string& model = problem.predictor->model_name();
  if (model == "puck" || model == "pivot" || model == "smooth") return -1;
  constexpr int kHighest = 3;
  std::vector<int> arcs;
  for (int arc = 0; arc < static_cast<int>(problem.arcs.size()); ++arc)
    if (of_track < 0 || problem.arcs[arc].track == of_track) arcs.push_back(arc);
  double rows = 0.0, chi2 = 0.0;
  for (const int arc : arcs) {
    const ArcData& data = problem.arcs[arc];
    // A tilt or an azimuth in the track says more about the motion than the path does.
    if (data.observable_index(model::Observable::x_m) < 0 ||
        data.observable_index(model::Observable::phi_rad) >= 0 ||
        data.observable_index(model::Observable::theta_rad) >= 0)
      return -1;
    Eigen::VectorXd r;
    if (!evaluate(problem, arc, u, r, nullptr)) return -1;
    for (const Reading& reading : data.readings)
      if (reading.channel == Channel::position) {
        chi2 += r.segment<2>(reading.row).squaredNorm();
        rows += 2.0;
      }
  }
  // Losses that mean nothing do not count against the model.
  const auto counted =
      std::count_if(problem.free.begin(), problem.free.end(), [&](const FreeParameter& parameter) {
        if (of_track >= 0)
          return parameter.arc >= 0 && problem.arcs[parameter.arc].track == of_track;
        return !is_loss(problem, parameter);
      });
  const double bic = chi2 + static_cast<double>(counted) * std::log(rows);
  for (int degree = 0; degree <= kHighest; ++degree) {
    double sum = 0.0;
    for (const int arc : arcs)
      sum += polynomial_chi2(problem, arc, degree) + 2.0 * (degree + 1) * std::log(rows);
    if (sum <= bic) return degree;
  }
  return -1;
}

constexpr const char* kPolynomialWords[] = {"a constant", "a straight line", "a parabola",
                                            "a cubic"};

std::vector<std::string> undetermined(const data::Fit& fit) {
  std::vector<std::string> names;
  for (const data::FitParameter& parameter : fit.parameters)
    if (parameter.status == data::ParameterStatus::free && !parameter.identifiable)
      names.push_back(parameter.name);
  return names;
}

void warn_unexplained(const Squares& sum, data::Fit& fit) {
  // Twice the scatter: more than a smoothing curve misjudges the noise.
  if (!sum.ok || sum.residual <= 4.0 * sum.scatter) return;
  fit.warnings.push_back(
      fmt::format("the residuals are {:.1f} times the scatter of the samples about a smooth curve: "
                  "the model lacks something, or a better minimum exists",
                  std::sqrt(sum.residual / sum.scatter)));
}

void refuse(FitOutcome outcome, FitVerdict verdict, std::string words, data::Fit& fit) {
  fit.converged = false;
  fit.outcome = outcome;
  fit.verdict = verdict;
  fit.reason = std::move(words);
  fit.verdict_words = fit.reason;
}

// Times the stated noise, of several tracks from the least to the largest.
std::string noise_words(const Problem& problem) {
  constexpr double kAlike = 1.1;
  double least = std::numeric_limits<double>::infinity(), most = 0.0;
  for (const ArcData& arc : problem.arcs) {
    least = std::min(least, main_noise_scale(arc));
    most = std::max(most, main_noise_scale(arc));
  }
  return most < kAlike * least ? fmt::format("{:.2g}", most)
                               : fmt::format("{:.2g} to {:.2g}", least, most);
}

void accept(const Problem& problem, const Solution& solution, const Uncertainty& error,
            const Misfit& worst, const GivenUp& lost, data::Fit& fit) {
  constexpr double kMany = 0.01;
  fit.converged = true;
  fit.outcome = FitOutcome::converged;
  fit.reason = fmt::format("{} iterations from {}", solution.iterations, fit.start_path);
  const double widened = error.widened;
  const bool correlated = error.whiteness.inflation > 1.0;
  const bool misses = worst.times > kDoubtful;
  const bool doubtful = misses || lost.more_than(kMany);
  const bool stated = std::none_of(problem.arcs.begin(), problem.arcs.end(),
                                   [](const ArcData& arc) { return arc.sigma_unknown; });
  std::string words = "the model explains the track";
  if (doubtful && !misses)
    words = "the model follows the track, but does not explain it: " + lost.words();
  else if (doubtful)
    words = fmt::format(
        "the model follows the track, but does not explain it: the residuals of {} are {:.2g} "
        "times their noise, the model lacks something, or a better minimum exists, and the error "
        "bars are too small",
        worst.words(), worst.times);
  else if (correlated)
    words += fmt::format(
        "{}; what is left hangs together over {:.2g} s, and the error bars are widened {:.2g} "
        "times for that",
        stated ? fmt::format(" to {} times its stated noise", noise_words(problem)) : "",
        error.whiteness.correlation_time_s, widened);
  else
    words += fmt::format(", and what is left looks like noise{}",
                         stated ? fmt::format(" ({} times the stated)", noise_words(problem)) : "");
  const std::vector<std::string> open = undetermined(fit);
  fit.verdict = doubtful        ? FitVerdict::doubtful
                : !open.empty() ? FitVerdict::weak
                : correlated    ? FitVerdict::good_correlated
                                : FitVerdict::good;
  if (!open.empty()) words += fmt::format("; not determined: {}", fmt::join(open, ", "));
  fit.verdict_words = words;
}

}  // namespace

void judge(const Problem& problem, const Solution& solution, const Uncertainty& error,
           bool cut_short, data::Fit& fit) {
  const Squares sum = squares(problem, solution);
  warn_unexplained(sum, fit);
  const Misfit worst = misfit(problem, sum);
  if (!solution.converged)
    return refuse(FitOutcome::no_convergence, FitVerdict::unexplained, solution.message, fit);
  if (!explains_path(sum))
    return refuse(FitOutcome::unexplained, FitVerdict::unexplained,
                  "the best path found leaves most of the motion unexplained", fit);
  if (worst.times > kHopeless)
    return refuse(FitOutcome::unexplained, FitVerdict::unexplained,
                  fmt::format("the model does not explain the track: the residuals of {} are "
                              "{:.2g} times their noise",
                              worst.words(), worst.times),
                  fit);
  // Where there are many valleys another one may explain what this one does not.
  if (cut_short && !is_tracked(problem) && worst.times * worst.times > chi2_gate(problem.rows()))
    return refuse(FitOutcome::unexplained, FitVerdict::unexplained,
                  fmt::format("the search ended at its limit, and the best path it found does not "
                              "explain the track: the residuals of {} are {:.2g} times their "
                              "noise",
                              worst.words(), worst.times),
                  fit);
  constexpr double kTooMany = 0.1;
  const GivenUp lost = given_up(problem, solution);
  if (lost.more_than(kTooMany))
    return refuse(FitOutcome::unexplained, FitVerdict::unexplained,
                  "the model does not explain the track: " + lost.words(), fit);
  if (const int degree = sufficient_polynomial(problem, solution.u); degree >= 0)
    return refuse(FitOutcome::not_identifiable, FitVerdict::no_feature,
                  fmt::format("{} in time explains the path as well: nothing in it asks for the "
                              "model '{}', whose parameters mean nothing here",
                              kPolynomialWords[degree], fit.model),
                  fit);
  accept(problem, solution, error, worst, lost, fit);
}

void doubt_if_a_track_shows_nothing(const Problem& problem, const Eigen::VectorXd& u,
                                    data::Fit& fit) {
  std::set<int> tracks;
  for (const ArcData& arc : problem.arcs) tracks.insert(arc.track);
  // Of a path that is not followed anything explains as much.
  if (tracks.size() < 2 || !says_explained(fit)) return;
  for (const int track : tracks) {
    const int degree = sufficient_polynomial(problem, u, track);
    if (degree < 0) continue;
    const std::string words = fmt::format(
        "{} in time explains the path of track {} as well: nothing in it asks for the "
        "model",
        kPolynomialWords[degree], track + 1);
    double times = 0.0;
    for (const ArcData& arc : problem.arcs)
      if (arc.track == track && !arc.sigma_unknown) times = std::max(times, main_noise_scale(arc));
    if (!(times > kHopeless) || !says_explained(fit)) {
      fit.warnings.push_back(words);
      continue;
    }
    fit.verdict = FitVerdict::doubtful;
    fit.verdict_words = fmt::format(
        "the model follows the track, but does not explain it: {}, and its positions scatter by "
        "{:.2g} times what they state; is it the body?",
        words, times);
  }
}

bool says_explained(const data::Fit& fit) {
  return fit.verdict == FitVerdict::good || fit.verdict == FitVerdict::good_correlated ||
         fit.verdict == FitVerdict::weak;
}

bool explains(const Problem& problem, const Solution& solution) {
  const Squares sum = squares(problem, solution);
  return explains_path(sum) && misfit(problem, sum).times <= kDoubtful;
}

}  // namespace trochoid::fitting
