#include "choose/held_back.hpp"

#include <fmt/core.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "observe/angles.hpp"
#include "observe/arcs.hpp"
#include "trochoid/data/angle.hpp"
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
  void add(double deviation) {
    sum += deviation * deviation;
    ++rows;
  }
};

void add_squares(const data::TrackSample& sample, const Eigen::Vector3d& predicted, bool angle_only,
                 SumOfSquares& squares) {
  if (angle_only && sample.psi) {
    const double off = data::wrapped(predicted[2] - sample.psi->value_rad);
    squares.add(off / sample.psi->sigma_rad);
  }
  if (angle_only || !sample.has_metres()) return;
  const Eigen::Vector2d off = predicted.head<2>() - sample.centre_m;
  // Without covariances in metres; the caller divides by the fitted part's rms.
  const Eigen::Matrix2d covariance =
      sample.has_covariance() ? sample.covariance_m2 : Eigen::Matrix2d::Identity();
  const Eigen::Matrix2d L = covariance.llt().matrixL();
  const Eigen::Vector2d whitened = L.triangularView<Eigen::Lower>().solve(off);
  squares.add(whitened.x());
  squares.add(whitened.y());
}

// Sum of squares of the samples [first, last) of a track, predicted from the fit's last arc of that
// track.
SumOfSquares squares_of(const data::Track& track, int first, int last, int track_index,
                        const data::Scene& scene, const data::Fit& fit) {
  SumOfSquares squares;
  int arc = -1;
  for (std::size_t i = 0; i < fit.arcs.size(); ++i)
    if (fit.arcs[i].track == track_index) arc = static_cast<int>(i);
  if (arc < 0) return squares;
  std::vector<double> t_s, row_px;
  std::vector<const data::TrackSample*> samples;
  for (int i = first; i < last; ++i) {
    const data::TrackSample& sample = track.samples[static_cast<std::size_t>(i)];
    if (sample.t_s < fit.arcs[static_cast<std::size_t>(arc)].from_s) continue;
    t_s.push_back(sample.t_s);
    row_px.push_back(sample.centre_px.y());
    samples.push_back(&sample);
  }
  model::PredictRequest request;
  request.t_s = t_s;
  request.start_s = fit.arcs[static_cast<std::size_t>(arc)].from_s;
  request.observables.push_back(model::Observable::psi_rad);
  request.lies_where_it_fell = true;
  const bool angle_only = fit.model == "pivot";
  const model::Prediction run =
      fitted_prediction(fit, scene, static_cast<std::size_t>(arc), request, row_px);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Eigen::Vector3d at = run.values.segment<3>(3 * static_cast<Eigen::Index>(i));
    if (at.allFinite())
      add_squares(*samples[i], at, angle_only, squares);
    else
      squares.add(kInfinity);  // the model ends before the body does
  }
  return squares;
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
  SumOfSquares seen, unseen;
  bool sigma_known = true;
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    const auto [first, last] = chosen_range(tracks[i], options.from, options.to);
    const int split = kept_samples(first, last, kHeldBack);
    const int index = static_cast<int>(i);
    const SumOfSquares before = squares_of(tracks[i], first, split, index, rung.scene, early);
    const SumOfSquares after = squares_of(tracks[i], split, last, index, rung.scene, early);
    seen.sum += before.sum, seen.rows += before.rows;
    unseen.sum += after.sum, unseen.rows += after.rows;
    for (int k = first; k < last; ++k)
      sigma_known =
          sigma_known && (early.model == "pivot" ||
                          tracks[i].samples[static_cast<std::size_t>(k)].has_covariance());
  }
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
