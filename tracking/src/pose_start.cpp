#include "pose_start.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "outline_samples.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::tracking {
namespace {

// Angle between axis and line of sight from the ratio of the silhouette's axes,
// b/a = cos v + (h/R) sin v  (orthographic), on the branch v in [0, pi/2].
double view_tilt(const data::Body& body, double ratio) {
  const double slope = body.half_thickness_m() / body.radius_m;
  const double peak = std::atan(slope), height = std::hypot(1.0, slope);
  return std::clamp(peak + std::acos(std::clamp(ratio / height, 0.0, 1.0)), 0.0,
                    0.5 * std::numbers::pi);
}

// Puts the centre on the ray through a pixel at the height the support wants.
std::optional<data::Pose<>> on_ray(const data::Camera& camera, const PoseMotion& motion,
                                   data::Pose<> pose, const Eigen::Vector2d& centre_px) {
  pose = motion.settled(pose);
  try {
    pose.centre_m = camera.table_from_image(centre_px, pose.centre_m.z());
  } catch (const NumericalError&) {
    return std::nullopt;
  }
  return pose;
}

// Directions across the line of sight that the axes of the detected ellipse stand for.
struct ViewFrame {
  Eigen::Vector3d towards, along_minor;
};

ViewFrame view_frame(const data::Camera& camera, const Eigen::Vector3d& at_m, double angle_rad) {
  const Eigen::Vector3d towards = direction_to(camera, at_m);
  const Eigen::Vector2d minor_px{-std::sin(angle_rad), std::cos(angle_rad)};
  const Eigen::Matrix<double, 2, 3> J = camera.jacobian_px_per_m(at_m);
  // Least-norm motion with this image; what is along the line of sight leaves no trace.
  Eigen::Vector3d minor = J.transpose() * (J * J.transpose()).inverse() * minor_px;
  minor -= minor.dot(towards) * towards;
  return {towards, minor.normalized()};
}

std::vector<data::Pose<>> free_starts(const data::Body& body, const data::Camera& camera,
                                      const PoseMotion& motion, const Detection& detection) {
  std::vector<data::Pose<>> starts;
  data::Pose<> level;
  const auto first = on_ray(camera, motion, level, detection.centre_px);
  if (!first) return starts;
  const ViewFrame view = view_frame(camera, first->centre_m, detection.angle_rad);
  const double ratio = detection.semi_minor_px / std::max(detection.semi_major_px, 1e-9);
  const double tilt = view_tilt(body, ratio);
  const auto add = [&](double v, double sign) {
    data::Pose<> pose = *first;
    set_axis(std::cos(v) * view.towards + sign * std::sin(v) * view.along_minor, pose);
    if (const auto placed = on_ray(camera, motion, pose, detection.centre_px))
      starts.push_back(*placed);
  };
  if (motion.rotation() < 0) return {*first};
  // A shadow in the silhouette changes the ratio; the outline decides.
  for (const double change : {0.0, 0.25, -0.25}) {
    const double v = tilt + change;
    if (v < -0.2 || v > 0.5 * std::numbers::pi + 0.1) continue;
    add(std::max(v, 0.02), 1.0);
    add(std::max(v, 0.02), -1.0);
  }
  return starts;
}

// With a pivot, where the centre is on its ray gives the axis: keep what fits the ellipse best.
std::vector<data::Pose<>> pivot_starts(const data::Body& body, const data::Support& support,
                                       const data::Camera& camera, const Detection& detection) {
  struct Candidate {
    double misfit;
    data::Pose<> pose;
  };
  constexpr int kTried = 60;
  constexpr size_t kKept = 4;
  std::vector<Candidate> candidates;
  const data::Ray ray = camera.ray_from_image(detection.centre_px);
  const double nearest_m = (*support.pivot_m - ray.origin_m).dot(ray.direction);
  const ViewFrame view = view_frame(camera, *support.pivot_m, detection.angle_rad);
  const double tilt =
      view_tilt(body, detection.semi_minor_px / std::max(detection.semi_major_px, 1e-9));
  for (int i = 0; i < kTried; ++i) {
    const double along = nearest_m + 6.0 * body.radius_m * (2.0 * (i + 0.5) / kTried - 1.0);
    data::Pose<> pose;
    pose.centre_m = ray.origin_m + along * ray.direction;
    const Eigen::Vector3d arm = pose.centre_m - *support.pivot_m;
    if (arm.norm() < 0.1 * body.radius_m || pose.centre_m.z() < 0.0) continue;
    set_axis(arm.normalized(), pose);
    const Eigen::Vector3d seen = axis_towards(camera, pose);
    const Eigen::Vector3d expected =
        std::cos(tilt) * view.towards +
        std::copysign(std::sin(tilt), seen.dot(view.along_minor)) * view.along_minor;
    candidates.push_back({(seen - expected).norm(), pose});
  }
  std::sort(candidates.begin(), candidates.end(),
            [](const Candidate& a, const Candidate& b) { return a.misfit < b.misfit; });
  std::vector<data::Pose<>> starts;
  for (size_t i = 0; i < std::min(kKept, candidates.size()); ++i)
    starts.push_back(candidates[i].pose);
  return starts;
}

}  // namespace

std::vector<data::Pose<>> starts_from_detection(const data::Body& body,
                                                const data::Support& support,
                                                const data::Camera& camera,
                                                const PoseMotion& motion,
                                                const Detection& detection) {
  if (support.kind == data::SupportKind::pivot)
    return pivot_starts(body, support, camera, detection);
  return free_starts(body, camera, motion, detection);
}

data::Pose<> mirrored(const data::Camera& camera, const PoseMotion& motion,
                      const data::Pose<>& pose) {
  const Eigen::Vector3d towards = direction_to(camera, pose.centre_m);
  const Eigen::Vector3d k = data::symmetry_axis(pose.theta_rad, pose.phi_rad);
  data::Pose<> other = pose;
  set_axis(2.0 * k.dot(towards) * towards - k, other);
  const auto placed = on_ray(camera, motion, other, camera.image_from_table<double>(pose.centre_m));
  return placed ? *placed : pose;
}

}  // namespace trochoid::tracking
