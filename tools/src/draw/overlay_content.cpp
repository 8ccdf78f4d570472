#include "draw/overlay_content.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "common/fitted_scene.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

std::optional<data::Scene> shown_scene(const OverlayInput& input) {
  if (input.scene) return input.scene;
  if (input.fit && !input.fit->scene_toml.empty()) return scene_of(*input.fit);
  return std::nullopt;
}

bool has_shape(const std::optional<data::Scene>& scene) {
  return scene && scene->body && scene->body->radius_m > 0.0;
}

// A camera file may have gone since.
bool has_camera(const data::Scene& scene) {
  std::error_code ignored;
  return scene.camera.file.empty() || fs::exists(scene.camera.file, ignored);
}

// Whether a track's metres were seen through this camera: somewhere between the floor and a radius
// above it each centre lies on its pixel, but for those that are doubtful.
bool saw(const data::Camera& camera, const data::TrackFile& tracks, double radius_m) {
  constexpr double kFewPx = 3.0;
  std::vector<double> off_px;
  for (const data::Track& track : tracks.tracks)
    for (const data::TrackSample& sample : track.samples) {
      if (!sample.has_metres() || !sample.centre_px.allFinite()) continue;
      const auto seen = [&](double z_m) {
        return camera.image_from_table<double>({sample.centre_m.x(), sample.centre_m.y(), z_m});
      };
      const Eigen::Vector2d low = seen(0.0), along = seen(radius_m) - low;
      const double length2 = std::max(along.squaredNorm(), 1e-12);
      const double at = std::clamp((sample.centre_px - low).dot(along) / length2, 0.0, 1.0);
      off_px.push_back((sample.centre_px - low - at * along).norm());
    }
  return off_px.empty() || data::median(std::move(off_px)) < kFewPx;
}

}  // namespace

std::optional<data::Camera> camera_from_track(const data::TrackFile& tracks, int width_px,
                                              int height_px) {
  // x_px = p x + q y + u,  y_px = q x - p y + v: p = s cos a, q = s sin a; image y points down.
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e300), high = -low;
  for (const data::Track& track : tracks.tracks)
    for (const data::TrackSample& sample : track.samples) {
      if (!sample.has_metres() || !sample.centre_px.allFinite()) continue;
      const double x = sample.centre_m.x(), y = sample.centre_m.y();
      const Eigen::Vector4d row_x(x, y, 1.0, 0.0), row_y(-y, x, 0.0, 1.0);
      normal += row_x * row_x.transpose() + row_y * row_y.transpose();
      right += row_x * sample.centre_px.x() + row_y * sample.centre_px.y();
      low = low.cwiseMin(sample.centre_px);
      high = high.cwiseMax(sample.centre_px);
    }
  // A scale from less than this much motion would be noise.
  constexpr double kLeastMotionPx = 5.0;
  if (!((high - low).norm() > kLeastMotionPx)) return std::nullopt;
  const Eigen::Vector4d solution = normal.ldlt().solve(right);
  const double p = solution[0], q = solution[1], scale = std::hypot(p, q);
  if (!(scale > 0.0) || !solution.allFinite()) return std::nullopt;
  data::Camera camera = data::Camera::from_scale(width_px, height_px, scale);
  camera.camera_from_table << p, q, 0.0, q, -p, 0.0, 0.0, 0.0, -scale;
  camera.camera_from_table /= scale;
  camera.camera_from_table_m.setZero();
  camera.cx = solution[2];
  camera.cy = solution[3];
  return camera;
}

void OverlayContent::check_pictures(int width_px, int height_px,
                                    const std::string& recording) const {
  if (camera_) camera_->check_size(width_px, height_px, recording);
}

OverlayContent::OverlayContent(const OverlayInput& input, int width_px, int height_px)
    : tracks_(input.tracks),
      scene_(shown_scene(input)),
      camera_(input.camera),
      frame_times_(input.tracks) {
  if (!camera_ && scene_ && has_camera(*scene_)) {
    camera_ = data::camera_of(*scene_, width_px, height_px);
    // A scale does not say where metres are counted from.
    if (camera_ && scene_->camera.file.empty() &&
        !saw(*camera_, tracks_, scene_->body ? scene_->body->radius_m : 0.0))
      camera_.reset();
  }
  if (!camera_) camera_ = camera_from_track(tracks_, width_px, height_px);
  if (input.fit && !input.fit->parameters.empty())
    prediction_ = replay(*input.fit, tracks_, input.fit_track);
  for (const data::Track& track : tracks_.tracks) collect(track);
  if (has_prediction()) {
    auto lists = residuals(tracks_, prediction_);
    for (std::size_t i = 0; i < objects_.size(); ++i) objects_[i].residuals = std::move(lists[i]);
  }
  collect_times();
}

void OverlayContent::collect(const data::Track& track) {
  ObjectPaths& paths = objects_.emplace_back();
  paths.object = track.object;
  Eigen::Vector3d sum_m = Eigen::Vector3d::Zero();
  int with_metres = 0;
  for (const data::TrackSample& sample : track.samples) {
    Eigen::Vector3d centre_m(sample.centre_m.x(), sample.centre_m.y(), 0.0);
    if (const auto pose = prediction_.at(track.object, sample.t_s))
      centre_m.z() = pose->centre_m.z();
    else if (has_shape(scene_))
      centre_m.z() = scene_->body->half_thickness_m();
    Eigen::Vector2d px = sample.centre_px;
    if (!px.allFinite() && camera_ && sample.has_metres()) px = camera_->image_from_table(centre_m);
    if (!px.allFinite())
      throw InputError(
          "the track has no pixel positions (x_px, y_px); give --camera so that its metres can be "
          "drawn into the picture");
    paths.observed.push_back({.frame = sample.frame, .t_s = sample.t_s, .px = px});
    if (sample.has_metres()) {
      sum_m += centre_m;
      ++with_metres;
    }
  }
  paths.usual_step_s = data::usual_step_s(paths.observed, &ObservedPoint::t_s);
  if (camera_ && with_metres > 0 && !scale_px_per_m_) {
    const auto jacobian = camera_->jacobian_px_per_m(sum_m / with_metres);
    scale_px_per_m_ = std::sqrt(std::abs(jacobian.leftCols<2>().determinant()));
  }
  if (!camera_) return;
  for (const PredictedArc& arc : prediction_.arcs) {
    if (arc.object != track.object) continue;
    PredictedLine& line = paths.predicted.emplace_back();
    line.t_s = arc.t_s;
    for (const data::Pose<>& pose : arc.pose)
      line.px.push_back(camera_->image_from_table(pose.centre_m));
  }
}

void OverlayContent::collect_times() {
  first_s_ = std::numeric_limits<double>::infinity();
  last_s_ = -first_s_;
  for (const ObjectPaths& paths : objects_)
    for (const ObservedPoint& point : paths.observed) {
      first_s_ = std::min(first_s_, point.t_s);
      last_s_ = std::max(last_s_, point.t_s);
    }
}

double OverlayContent::time_of_frame(std::int64_t frame, double fallback_s) const {
  return frame_times_.time_of(frame).value_or(fallback_s);
}

bool OverlayContent::detected(std::int64_t frame, double t_s) const {
  if (frame_times_.numbered()) return frame_times_.has(frame);
  return std::any_of(objects_.begin(), objects_.end(), [&](const ObjectPaths& paths) {
    return observed_in(paths, frame, t_s) != nullptr;
  });
}

const ObservedPoint* OverlayContent::observed_in(const ObjectPaths& paths, std::int64_t frame,
                                                 double t_s) const {
  const std::vector<ObservedPoint>& points = paths.observed;
  if (!points.empty() && points.front().frame >= 0) {
    const auto at = std::lower_bound(
        points.begin(), points.end(), frame,
        [](const ObservedPoint& point, std::int64_t number) { return point.frame < number; });
    return at != points.end() && at->frame == frame ? &*at : nullptr;
  }
  const auto away_s = [t_s](const ObservedPoint& point) { return std::abs(point.t_s - t_s); };
  auto nearest =
      std::lower_bound(points.begin(), points.end(), t_s,
                       [](const ObservedPoint& point, double t) { return point.t_s < t; });
  if (nearest != points.begin() &&
      (nearest == points.end() || away_s(*std::prev(nearest)) < away_s(*nearest)))
    --nearest;
  if (nearest == points.end()) return nullptr;
  constexpr double kRounding_s = 1e-9;
  return away_s(*nearest) <= 0.5 * paths.usual_step_s + kRounding_s ? &*nearest : nullptr;
}

std::optional<data::Pose<>> OverlayContent::tracked_pose(int object, std::int64_t frame) const {
  for (const data::Track& track : tracks_.tracks) {
    if (track.object != object) continue;
    const auto sample = std::lower_bound(
        track.samples.begin(), track.samples.end(), frame,
        [](const data::TrackSample& known, std::int64_t f) { return known.frame < f; });
    if (sample == track.samples.end() || sample->frame != frame || !sample->has_metres() ||
        !sample->theta || !sample->phi)
      return std::nullopt;
    data::Pose<> pose;
    pose.theta_rad = sample->theta->value_rad;
    pose.phi_rad = sample->phi->value_rad;
    const data::Body& body = *scene_->body;
    pose.centre_m = {
        sample->centre_m.x(), sample->centre_m.y(),
        data::height_on_floor_m(pose.theta_rad, body.radius_m, body.half_thickness_m())};
    return pose;
  }
  return std::nullopt;
}

std::vector<data::WireCurve> OverlayContent::wireframe_at(int object, std::int64_t frame,
                                                          double t_s) const {
  if (!has_shape(scene_) || !camera_) return {};
  std::optional<data::Pose<>> pose = prediction_.at(object, t_s);
  if (!pose && !has_prediction() && scene_->support.kind == data::SupportKind::floor)
    pose = tracked_pose(object, frame);
  if (!pose) return {};
  return data::wireframe(*scene_->body, *pose, *camera_);
}

std::optional<Eigen::Vector2d> OverlayContent::predicted_px(int object, double t_s) const {
  const auto pose = prediction_.at(object, t_s);
  if (!pose || !camera_) return std::nullopt;
  return camera_->image_from_table(pose->centre_m);
}

}  // namespace trochoid::tools
