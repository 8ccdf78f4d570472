#include "choose/held_back.hpp"

#include <fmt/core.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "observe/arcs.hpp"
#include "observe/observations.hpp"
#include "problem/problem.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::fitting {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kHeldBack = 1.0 / 3.0;

// Sum of squares of (prediction - measurement) / sigma.
struct SumOfSquares {
  double sum = 0.0;
  int rows = 0;
  void add(const Eigen::Ref<const Eigen::VectorXd>& deviations) {
    // Where the model ends before the body does it has no prediction.
    sum += deviations.allFinite() ? deviations.squaredNorm() : kInfinity;
    rows += static_cast<int>(deviations.size());
  }
};

// Of what was fitted and of what was held back.
struct Split {
  SumOfSquares seen, unseen;
  bool sigma_known = true;
};

// The last arc of a track in a fit that begins by then; null: it has none.
const data::FitArc* last_arc(const data::Fit& fit, int track, double by_s = kInfinity) {
  const data::FitArc* last = nullptr;
  for (const data::FitArc& arc : fit.arcs)
    if (arc.track == track && arc.from_s <= by_s) last = &arc;
  return last;
}

// A fit's residuals of readings that need not be those it was made from.
Eigen::VectorXd residuals_of(const ArcData& readings, const data::Fit& fit,
                             const data::FitArc& fitted, const data::Scene& scene) {
  model::PredictRequest request;
  request.t_s = readings.t_s;
  request.start_s = fitted.from_s;
  request.observables = readings.observables;
  request.lies_where_it_fell = true;
  const auto index = static_cast<std::size_t>(&fitted - fit.arcs.data());
  const model::Prediction run = fitted_prediction(fit, scene, index, request, readings.row_px);
  Eigen::VectorXd residuals;
  whiten(readings, run.values, {}, residuals, nullptr);
  return residuals;
}

// The stretch of a track that the fit of its first part follows, to where that of the whole does:
// no model knows of an impact that is still to come.
ArcData stretch_of(const data::Track& track, SampleRange range, double from_s, double to_s,
                   bool angle_only) {
  const auto time_s = [&](int i) { return track.samples[static_cast<std::size_t>(i)].t_s; };
  auto [first, last] = range;
  while (first < last && time_s(first) < from_s) ++first;
  while (last > first && time_s(last - 1) > to_s) --last;
  return make_arc(track, first, last, {.position = !angle_only, .psi = angle_only}, false);
}

void add_track(const data::Track& track, int index, SampleRange range, const Rung& rung,
               const data::Fit& early, Split& split) {
  // What the fit of the whole weighs by less than half.
  constexpr double kGivenUp = kInlier * std::numbers::sqrt2;
  const data::FitArc* part = last_arc(early, index);
  const data::FitArc* whole = part ? last_arc(rung.fit, index, part->to_s) : nullptr;
  if (whole == nullptr) return;
  const ArcData readings = stretch_of(track, range, std::max(part->from_s, whole->from_s),
                                      whole->to_s, early.model == "pivot");
  if (readings.readings.empty()) return;
  split.sigma_known = split.sigma_known && !readings.sigma_unknown;
  const Eigen::VectorXd off = residuals_of(readings, early, *part, rung.scene);
  const Eigen::VectorXd off_whole = residuals_of(readings, rung.fit, *whole, rung.scene);
  const int kept = kept_samples(range.first, range.second, kHeldBack);
  const double seen_s = track.samples[static_cast<std::size_t>(kept - 1)].t_s;
  for (const Reading& reading : readings.readings) {
    const int rows = rows_of(reading.channel);
    if (off_whole.segment(reading.row, rows).norm() > kGivenUp * whole->noise_scale) continue;
    const bool seen = readings.t_s[static_cast<std::size_t>(reading.sample)] <= seen_s;
    (seen ? split.seen : split.unseen).add(off.segment(reading.row, rows));
  }
}

// Fits the first two thirds, predicts the rest.
double held_back(std::span<const data::Track> tracks, const Rung& rung, FitOptions options) {
  options.rolls_at_first = rung.rolls_at_first;
  options.start = values_of(rung.fit);
  if (!options.start.empty()) options.strategy = Strategy::single;
  options.hold_back = kHeldBack;
  if (options.progress)
    options.progress = [say = options.progress](const std::string& stage) {
      say(fmt::format("without the last third, {}", stage));
    };
  const data::Fit early =
      fit_one_of_several(tracks, rung.scene, options, Bars::by_curvature, rung.settled);
  if (!usable(early)) return kInfinity;
  Split split;
  for (std::size_t i = 0; i < tracks.size(); ++i)
    add_track(tracks[i], static_cast<int>(i), chosen_range(tracks[i], options.from, options.to),
              rung, early, split);
  const auto& [seen, unseen, sigma_known] = split;
  if (unseen.rows == 0 || seen.rows == 0) return std::numeric_limits<double>::quiet_NaN();
  const double rms = std::sqrt(unseen.sum / unseen.rows);
  return sigma_known ? rms : rms / std::sqrt(std::max(seen.sum / seen.rows, 1e-300));
}

}  // namespace

void predict_held_back(std::span<const data::Track> tracks, const FitOptions& options, Rung& rung) {
  if (!rung.fitted || !rung.fit.converged || rung.by_score_test) return;
  try {
    rung.held_back_rms_sigma = held_back(tracks, rung, options);
  } catch (const Error&) {
    // A model that has no answer to part of the track does not predict the rest.
    rung.held_back_rms_sigma = kInfinity;
  }
}

}  // namespace trochoid::fitting
