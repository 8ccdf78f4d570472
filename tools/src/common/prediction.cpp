#include "common/prediction.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "common/constants.hpp"
#include "common/fitted_scene.hpp"
#include "common/provenance.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/fitting/fit.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::tools {
namespace {

using model::Observable;
constexpr int kFinest = 8;          // grid points per frame interval, enough for a smooth curve
constexpr int kMostPoints = 40000;  // per arc, bounds memory and time on long recordings

const data::Track* track_of(const data::TrackFile& file, int object) {
  for (const data::Track& track : file.tracks)
    if (track.object == object) return &track;
  return file.tracks.size() == 1 ? &file.tracks.front() : nullptr;
}

// Every sample time within the arc and a uniform subdivision between them, so that the curve is
// smooth, gaps are bridged and residuals need no interpolation.
std::vector<double> grid_of(const data::Track& track, const data::FitArc& arc) {
  std::vector<double> times;
  for (const data::TrackSample& sample : track.samples)
    if (sample.t_s >= arc.from_s && sample.t_s <= arc.to_s) times.push_back(sample.t_s);
  if (times.empty() || times.front() > arc.from_s) times.insert(times.begin(), arc.from_s);
  if (times.back() < arc.to_s) times.push_back(arc.to_s);
  const double span_s = times.back() - times.front();
  const int per_frame = std::clamp(kMostPoints / static_cast<int>(times.size()), 1, kFinest);
  const double step_s = span_s / (static_cast<double>(times.size() - 1) * per_frame);
  std::vector<double> grid{times.front()};
  for (std::size_t i = 1; i < times.size(); ++i) {
    const double length_s = times[i] - times[i - 1];
    const int pieces = std::max(1, static_cast<int>(std::ceil(length_s / step_s - 0.5)));
    for (int k = 1; k < pieces; ++k) grid.push_back(times[i - 1] + length_s * k / pieces);
    grid.push_back(times[i]);
  }
  return grid;
}

// Rows of the image in which the body was at these times, straight from sample to sample.
std::vector<double> rows_of(const data::Track& track, const std::vector<double>& t_s) {
  std::vector<const data::TrackSample*> seen;
  for (const data::TrackSample& sample : track.samples)
    if (std::isfinite(sample.centre_px.y())) seen.push_back(&sample);
  if (seen.empty()) return {};
  std::vector<double> rows_px;
  std::size_t next = 0;
  for (const double t : t_s) {
    while (next < seen.size() && seen[next]->t_s < t) ++next;
    const data::TrackSample &after = *seen[std::min(next, seen.size() - 1)],
                            &before = *seen[next == 0 ? 0 : next - 1];
    const double width_s = after.t_s - before.t_s;
    const double w = width_s > 0.0 ? std::clamp((t - before.t_s) / width_s, 0.0, 1.0) : 0.0;
    rows_px.push_back(std::lerp(before.centre_px.y(), after.centre_px.y(), w));
  }
  return rows_px;
}

bool models_tilt(const std::string& model) {
  return model != "puck" && model != "pivot";
}

// Height of the CoM above the floor [m]: the models' x, y, theta determine it once the support is
// known.
double height_m(const data::Scene& scene, const std::string& model, const data::Fit& fit,
                double theta_rad) {
  if (model == "top" || model == "top-euler") {
    const double pivot_m = scene.support.pivot_m ? scene.support.pivot_m->z() : 0.0;
    const data::FitParameter* l = fit.find("l_m");
    const double l_m = l != nullptr ? l->value : scene.body ? scene.body->l_m.value_or(0.0) : 0.0;
    return pivot_m + l_m * std::cos(theta_rad);
  }
  if (!scene.body) return 0.0;
  if (!models_tilt(model)) return scene.body->half_thickness_m();
  return data::height_on_floor_m(theta_rad, scene.body->radius_m, scene.body->half_thickness_m());
}

std::vector<Observable> observables_of(const std::string& model) {
  std::vector<Observable> wanted{Observable::x_m, Observable::y_m};
  if (models_tilt(model)) wanted.insert(wanted.end(), {Observable::theta_rad, Observable::phi_rad});
  wanted.push_back(Observable::psi_rad);
  return wanted;
}

PredictedArc replay_arc(const std::string& model, const data::Fit& fit, const data::Scene& scene,
                        const data::Track& track, std::size_t arc_index) {
  const data::FitArc& arc = fit.arcs[arc_index];
  PredictedArc replayed;
  replayed.object = arc.object;
  replayed.from_s = arc.from_s;
  replayed.to_s = arc.to_s;
  replayed.has_tilt = models_tilt(model);
  if (fit.converged) replayed.noise_scale = arc.noise_scale;
  replayed.t_s = grid_of(track, arc);
  model::PredictRequest request;
  request.t_s = replayed.t_s;
  request.start_s = arc_start_s(fit, arc_index);
  request.observables = observables_of(model);
  request.lies_where_it_fell = true;
  const model::Prediction run =
      fitting::fitted_prediction(fit, scene, arc_index, request, rows_of(track, replayed.t_s));
  const bool goes_on =
      run.outcome == model::Outcome::reached_end || run.outcome == model::Outcome::flat;
  if (!goes_on) replayed.ended = sentence(run.outcome);
  const auto columns = static_cast<Eigen::Index>(request.observables.size());
  for (std::size_t n = 0; n < replayed.t_s.size(); ++n) {
    const auto row = run.values.segment(static_cast<Eigen::Index>(n) * columns, columns);
    data::Pose<> pose;
    if (replayed.has_tilt) {
      pose.theta_rad = row[2];
      pose.phi_rad = row[3];
    }
    pose.psi_rad = row[columns - 1];
    pose.centre_m = {row[0], row[1], height_m(scene, model, fit, pose.theta_rad)};
    replayed.pose.push_back(pose);
  }
  return replayed;
}

// A disc on a pivot is drawn where it was seen: its place is no prediction.
void put_where_seen(PredictedArc& arc, const data::Track& track) {
  Eigen::Vector2d sum_m = Eigen::Vector2d::Zero();
  int count = 0;
  for (const data::TrackSample& sample : track.samples) {
    if (!sample.has_metres()) continue;
    sum_m += sample.centre_m;
    ++count;
  }
  if (count == 0) return;
  for (data::Pose<>& pose : arc.pose) pose.centre_m.head<2>() = sum_m / count;
}

}  // namespace

const data::Track* track_of_arc(const data::Fit& fit, std::size_t arc, const data::TrackFile& file,
                                int first_track) {
  const int place = fit.arcs[arc].track - first_track;
  if (place < 0 || place >= tracks_fitted(fit, file)) return nullptr;
  const data::Track* track = track_of(file, fit.arcs[arc].object);
  return track == nullptr || track->samples.empty() ? nullptr : track;
}

PredictedPath replay(const data::Fit& fit, const data::TrackFile& tracks, int track_index) {
  const data::Scene scene = scene_of(fit);
  PredictedPath path{.model = fit.model, .arcs = {}};
  for (std::size_t i = 0; i < fit.arcs.size(); ++i)
    if (const data::Track* track = track_of_arc(fit, i, tracks, track_index)) {
      path.arcs.push_back(replay_arc(path.model, fit, scene, *track, i));
      if (path.angles_alone()) put_where_seen(path.arcs.back(), *track);
    }
  if (path.arcs.empty())
    throw InputError(fmt::format(
        "the fit holds no arc of this track (object or track number {} is missing); give the fit "
        "that was made from this track",
        track_index));
  return path;
}

std::optional<Eigen::VectorXd> replay_first_arc(const data::Fit& fit, const data::TrackFile& tracks,
                                                int track_index, double tolerance) {
  for (std::size_t i = 0; i < fit.arcs.size(); ++i) {
    const data::Track* track = track_of_arc(fit, i, tracks, track_index);
    if (track == nullptr) continue;
    const std::vector<double> grid = grid_of(*track, fit.arcs[i]);
    model::PredictRequest request;
    request.t_s = grid;
    request.start_s = arc_start_s(fit, i);
    request.tolerance = tolerance;
    const model::Prediction run =
        fitting::fitted_prediction(fit, scene_of(fit), i, request, rows_of(*track, grid));
    if (run.outcome != model::Outcome::reached_end) return std::nullopt;
    return run.values;
  }
  return std::nullopt;
}

const PredictedArc* PredictedPath::arc_at(int object, double t_s) const {
  for (const PredictedArc& arc : arcs)
    if (arc.object == object && !arc.t_s.empty() && t_s >= arc.t_s.front() && t_s <= arc.t_s.back())
      return &arc;
  return nullptr;
}

std::optional<data::Pose<>> PredictedPath::at(int object, double t_s) const {
  const PredictedArc* arc = arc_at(object, t_s);
  if (arc == nullptr) return std::nullopt;
  const auto after = std::lower_bound(arc->t_s.begin(), arc->t_s.end(), t_s);
  const auto high = static_cast<std::size_t>(after - arc->t_s.begin());
  const std::size_t low = high == 0 ? 0 : high - 1;
  const double width_s = arc->t_s[high] - arc->t_s[low];
  const double w = width_s > 0.0 ? (t_s - arc->t_s[low]) / width_s : 0.0;
  const data::Pose<>&a = arc->pose[low], &b = arc->pose[high];
  // w = 1 at a grid point: b alone, so that a NaN before the start of validity does not leak in.
  if (w >= 1.0) return b.centre_m.allFinite() ? std::optional(b) : std::nullopt;
  const auto mix = [w](const auto& u, const auto& v) { return u + w * (v - u); };
  data::Pose<> pose;
  pose.centre_m = a.centre_m + w * (b.centre_m - a.centre_m);
  pose.theta_rad = mix(a.theta_rad, b.theta_rad);
  pose.phi_rad = mix(a.phi_rad, b.phi_rad);
  pose.psi_rad = mix(a.psi_rad, b.psi_rad);
  if (!pose.centre_m.allFinite()) return std::nullopt;
  return pose;
}

std::optional<double> spin_residual_rad(const data::TrackSample& sample, int object,
                                        const PredictedPath& path) {
  const PredictedArc* arc = path.arc_at(object, sample.t_s);
  if (!sample.psi || arc == nullptr) return std::nullopt;
  const auto pose = path.at(object, sample.t_s);
  if (!pose) return std::nullopt;
  return data::wrapped(sample.psi->value_rad - pose->psi_rad);
}

std::vector<std::vector<Residual>> residuals(const data::TrackFile& tracks,
                                             const PredictedPath& path) {
  std::vector<std::vector<Residual>> all;
  for (const data::Track& track : tracks.tracks) {
    std::vector<Residual>& list = all.emplace_back();
    if (path.angles_alone()) continue;
    for (const data::TrackSample& sample : track.samples) {
      const auto pose = path.at(track.object, sample.t_s);
      if (!sample.has_metres() || !pose) continue;
      const double scale = path.arc_at(track.object, sample.t_s)->noise_scale;
      Residual residual{sample.frame, sample.t_s, {}, {}, scale};
      residual.value_m = sample.centre_m - pose->centre_m.head<2>();
      residual.sigma_m = sample.has_covariance()
                             ? Eigen::Vector2d(scale * sample.covariance_m2.diagonal().cwiseSqrt())
                             : Eigen::Vector2d(kNaN, kNaN);
      list.push_back(residual);
    }
  }
  return all;
}

double rms_m(const std::vector<Residual>& residuals) {
  if (residuals.empty()) return kNaN;
  double sum_m2 = 0.0;
  for (const Residual& residual : residuals) sum_m2 += residual.value_m.squaredNorm();
  return std::sqrt(0.5 * sum_m2 / static_cast<double>(residuals.size()));
}

}  // namespace trochoid::tools
