#include "pose/pose_start.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>

#include "geometry/outline_samples.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/parallel.hpp"

namespace trochoid::tracking {
namespace {

constexpr size_t kMostStarts = 10;

// Puts the centre on the ray through a pixel at the height the support wants.
std::optional<data::Pose<>> on_ray(const data::Camera& camera, const data::PoseMotion& motion,
                                   data::Pose<> pose, const Eigen::Vector2d& centre_px) {
  pose = motion.settled(pose);
  try {
    pose.centre_m = camera.table_from_image(centre_px, pose.centre_m.z());
  } catch (const NumericalError&) {
    return std::nullopt;
  }
  return pose;
}

struct PlaceCandidate {
  double score;
  data::Pose<> pose;
  Eigen::Vector2d centre_px;
};

// Attitudes about `step_rad` apart, from lying flat to nearly upright.
std::vector<data::Pose<>> attitudes(double step_rad) {
  constexpr double kUpright = 1.5;
  std::vector<data::Pose<>> all(1);
  const auto add = [&](double theta_rad, double phi_rad) {
    all.emplace_back();
    all.back().theta_rad = theta_rad;
    all.back().phi_rad = phi_rad;
  };
  const int rings = static_cast<int>(std::lround(kUpright / step_rad));
  for (int ring = 1; ring <= rings; ++ring) {
    const double theta = kUpright * ring / rings;
    const int around =
        std::max(4, static_cast<int>(std::lround(data::kTurn * std::sin(theta) / step_rad)));
    for (int i = 0; i < around; ++i) add(theta, data::kTurn * (i + 0.5 * (ring % 2)) / around);
  }
  return all;
}

struct SilhouetteSearch {
  const data::Body& body;
  const data::Camera& camera;
  const data::PoseMotion& motion;
  const EdgeMap& map;
  double radius_px;
};

// Silhouette of a pose as cells of the map relative to the cell of its centre.
struct CellPoint {
  int x, y, direction;
};
std::vector<CellPoint> silhouette_cells(const SilhouetteSearch& search, const data::Pose<>& pose) {
  constexpr double kPoints = 40.0;
  std::vector<CellPoint> cells;
  const Eigen::Vector2d centre = search.camera.image_from_table<double>(pose.centre_m);
  const double step_px = data::kTurn * search.radius_px / kPoints;
  for (const auto& p : data::visible_outline(search.body, pose, search.camera, step_px)) {
    if (!tells_outline(p)) continue;
    const Eigen::Vector2d off = (p.image_px - centre) / search.map.cell_px();
    cells.push_back({static_cast<int>(std::lround(off.x())), static_cast<int>(std::lround(off.y())),
                     EdgeMap::direction_of(p.normal_px.x(), p.normal_px.y())});
  }
  return cells;
}

// Mean strength of the edges under a silhouette for every cell its centre may be in.
cv::Mat silhouette_scores(const SilhouetteSearch& search, const std::vector<CellPoint>& cells) {
  const cv::Size size = search.map.strength(0).size();
  cv::Mat sum = cv::Mat::zeros(size, CV_32FC1);
  const cv::Rect all({}, size);
  for (const CellPoint& c : cells) {
    const cv::Rect to = all & (all - cv::Point(c.x, c.y));
    if (to.empty()) continue;
    cv::Mat part = sum(to);
    part += search.map.strength(c.direction)(to + cv::Point(c.x, c.y));
  }
  return sum / static_cast<double>(std::max<size_t>(1, cells.size()));
}

// The places of its centre where the silhouette of an attitude lies on edges best.
std::vector<PlaceCandidate> best_places(const SilhouetteSearch& search,
                                        const data::Pose<>& attitude,
                                        const Eigen::Vector2d& about_px) {
  constexpr int kPerAttitude = 2;
  std::vector<PlaceCandidate> found;
  const auto middle = on_ray(search.camera, search.motion, attitude, about_px);
  if (!middle) return found;
  cv::Mat scores = silhouette_scores(search, silhouette_cells(search, *middle));
  for (int k = 0; k < kPerAttitude; ++k) {
    double best = 0.0;
    cv::Point at;
    cv::minMaxLoc(scores, nullptr, &best, nullptr, &at);
    const Eigen::Vector2d centre(search.map.window().x + (at.x + 0.5) * search.map.cell_px(),
                                 search.map.window().y + (at.y + 0.5) * search.map.cell_px());
    if (const auto placed = on_ray(search.camera, search.motion, attitude, centre))
      found.push_back({best, *placed, centre});
    const cv::Rect around(at.x - 3, at.y - 3, 7, 7);
    scores(around & cv::Rect({}, scores.size())).setTo(0.0);
  }
  return found;
}

std::vector<PlaceCandidate> joined(const std::vector<std::vector<PlaceCandidate>>& parts) {
  std::vector<PlaceCandidate> all;
  for (const auto& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

// On the floor the silhouette of an attitude hardly depends on where it is: one template each.
std::vector<PlaceCandidate> seek_on_floor(const SilhouetteSearch& search,
                                          const Eigen::Vector2d& about_px) {
  constexpr double kAttitudeStep = 0.21;
  const std::vector<data::Pose<>> all =
      search.motion.rotation() < 0 ? std::vector{data::Pose<>()} : attitudes(kAttitudeStep);
  std::vector<std::vector<PlaceCandidate>> found(all.size());
  data::in_parallel(all.size(), 2,
                    [&](size_t i) { found[i] = best_places(search, all[i], about_px); });
  return joined(found);
}

// The attitudes of an axis through the pivot with the centre so far along it.
std::vector<PlaceCandidate> seek_at_distance(const SilhouetteSearch& search,
                                             const Eigen::Vector3d& pivot_m, double along_m,
                                             double cell_m) {
  std::vector<PlaceCandidate> found;
  const cv::Rect all({}, search.map.strength(0).size());
  for (data::Pose<> pose : attitudes(std::clamp(1.5 * cell_m / along_m, 0.06, 0.21))) {
    pose.centre_m = pivot_m + along_m * axis_of(pose);
    const Eigen::Vector2d centre = search.camera.image_from_table<double>(pose.centre_m);
    const cv::Point cell(
        static_cast<int>((centre.x() - search.map.window().x) / search.map.cell_px()),
        static_cast<int>((centre.y() - search.map.window().y) / search.map.cell_px()));
    if (!all.contains(cell)) continue;
    const std::vector<CellPoint> cells = silhouette_cells(search, pose);
    double sum = 0.0;
    for (const CellPoint& c : cells)
      if (const cv::Point at = cell + cv::Point(c.x, c.y); all.contains(at))
        sum += search.map.strength(c.direction).at<float>(at);
    found.push_back({sum / static_cast<double>(std::max<size_t>(1, cells.size())), pose, centre});
  }
  return found;
}

// An axis through the pivot: the attitude and the distance along the axis place everything.
std::vector<PlaceCandidate> seek_about_pivot(const SilhouetteSearch& search,
                                             const Eigen::Vector3d& pivot_m) {
  constexpr double kFarthest = 6.0;  // radii from the pivot
  const double cell_m = search.map.cell_px() * search.body.radius_m / search.radius_px;
  std::vector<double> distances_m;
  for (double along = 0.1 * search.body.radius_m; along < kFarthest * search.body.radius_m;
       along += std::max(2.0 * cell_m, 0.1 * along))
    distances_m.push_back(along);
  std::vector<std::vector<PlaceCandidate>> found(distances_m.size());
  data::in_parallel(distances_m.size(), 2, [&](size_t i) {
    found[i] = seek_at_distance(search, pivot_m, distances_m[i], cell_m);
  });
  return joined(found);
}

bool alike(const PlaceCandidate& a, const PlaceCandidate& b, double radius_px) {
  constexpr double kSameAttitude = 0.25;
  const Eigen::Vector3d k = data::symmetry_axis(a.pose.theta_rad, a.pose.phi_rad);
  const Eigen::Vector3d m = data::symmetry_axis(b.pose.theta_rad, b.pose.phi_rad);
  return (a.centre_px - b.centre_px).norm() < 0.2 * radius_px && (k - m).norm() < kSameAttitude;
}

std::vector<data::Pose<>> best_distinct(std::vector<PlaceCandidate> found, double radius_px) {
  std::sort(found.begin(), found.end(),
            [](const PlaceCandidate& a, const PlaceCandidate& b) { return a.score > b.score; });
  std::vector<PlaceCandidate> kept;
  for (const PlaceCandidate& c : found) {
    if (kept.size() == kMostStarts) break;
    if (std::none_of(kept.begin(), kept.end(),
                     [&](const PlaceCandidate& other) { return alike(c, other, radius_px); }))
      kept.push_back(c);
  }
  std::vector<data::Pose<>> starts;
  for (const PlaceCandidate& c : kept) starts.push_back(c.pose);
  return starts;
}

// How large the body appears about a pixel [px].
double radius_in_picture(const data::Body& body, const data::Camera& camera,
                         const data::PoseMotion& motion, const Eigen::Vector2d& at_px) {
  const auto level = on_ray(camera, motion, {}, at_px);
  if (!level) return 0.0;
  const Eigen::Matrix<double, 2, 3> J = camera.jacobian_px_per_m(level->centre_m);
  return body.radius_m * J.col(0).norm();
}

}  // namespace

std::vector<data::Pose<>> starts_from_edges(const data::Body& body, const data::Support& support,
                                            const data::Camera& camera,
                                            const data::PoseMotion& motion,
                                            const OutlineView& view) {
  const Detection& detection = *view.detection;
  constexpr double kCellsPerRadius = 12.0;
  constexpr int kLargestCellPx = 5;
  const double radius_px = radius_in_picture(body, camera, motion, detection.centre_px);
  if (!(radius_px > 2.0)) return {};
  const int cell_px =
      std::clamp(static_cast<int>(std::lround(radius_px / kCellsPerRadius)), 1, kLargestCellPx);
  const int margin = static_cast<int>(0.6 * radius_px) + 4;
  const cv::Rect window =
      (detection.box + cv::Size(2 * margin, 2 * margin) - cv::Point(margin, margin)) &
      cv::Rect({}, view.luma.size());
  if (window.width < 3 || window.height < 3) return {};
  EdgeMap map(view.luma, view.background, window, cell_px);
  if (!view.chroma.empty()) map.add_colours(view.chroma, view.background_chroma);
  const SilhouetteSearch search{body, camera, motion, map, radius_px};
  return best_distinct(support.kind == data::SupportKind::pivot
                           ? seek_about_pivot(search, *support.pivot_m)
                           : seek_on_floor(search, detection.centre_px),
                       radius_px);
}

data::Pose<> mirrored(const data::Camera& camera, const data::PoseMotion& motion,
                      const data::Pose<>& pose) {
  const Eigen::Vector3d towards = direction_to(camera, pose.centre_m);
  const Eigen::Vector3d k = data::symmetry_axis(pose.theta_rad, pose.phi_rad);
  data::Pose<> other = pose;
  set_axis(2.0 * k.dot(towards) * towards - k, other);
  const auto placed = on_ray(camera, motion, other, camera.image_from_table<double>(pose.centre_m));
  return placed ? *placed : pose;
}

namespace {

// A body whose axis through the pivot is turned, moved along it until the point so far ahead of its
// centre is seen where a point of the scene is; nothing where that is on the other side of the
// pivot, as on a pin.
std::optional<data::Pose<>> turned_about(const Eigen::Vector3d& pivot_m,
                                         const Eigen::Vector3d& axis,
                                         const Eigen::Vector3d& towards,
                                         const Eigen::Vector3d& at_m, double ahead_m,
                                         data::Pose<> pose) {
  const auto across = [&](const Eigen::Vector3d& v) -> Eigen::Vector3d {
    return v - v.dot(towards) * towards;
  };
  const Eigen::Vector3d point = across(at_m - pivot_m), along = across(axis);
  const double point_m = point.dot(along) / along.squaredNorm();
  if (!(point_m > ahead_m)) return std::nullopt;
  pose.centre_m = pivot_m + (point_m - ahead_m) * axis;
  return pose;
}

// How a body is seen: the axis out of its near face, and what it leans aside from the line of
// sight.
struct View {
  Eigen::Vector3d towards, near, aside;
  double facing;  // cosine of the angle between the two

  View(const data::Camera& camera, const data::Pose<>& pose)
      : towards(direction_to(camera, pose.centre_m)), near(axis_towards(camera, pose)) {
    facing = near.dot(towards);
    aside = (near - facing * towards) / leaning();
  }
  [[nodiscard]] double leaning() const { return std::sqrt(std::max(0.0, 1.0 - facing * facing)); }
};

// The body with its near face tilted otherwise, and the point so far ahead of its centre seen where
// a point of the scene is.
std::optional<data::Pose<>> tilted(const data::Camera& camera, const data::PoseMotion& motion,
                                   const View& view, data::Pose<> pose, double facing, Side side,
                                   const Eigen::Vector3d& at_m, double ahead_m) {
  const double way = side == Side::same ? 1.0 : -1.0;
  const Eigen::Vector3d face =
      facing * view.towards + way * std::sqrt(std::max(0.0, 1.0 - facing * facing)) * view.aside;
  if (motion.pivoted()) {
    const auto turned = turned_about(motion.pivot_m(), face, view.towards, at_m, ahead_m, pose);
    return turned ? std::optional(motion.settled(*turned)) : std::nullopt;
  }
  set_axis(axis_of(pose).dot(view.near) > 0.0 ? face : Eigen::Vector3d(-face), pose);
  const Eigen::Vector3d centre_m = at_m - ahead_m * face;
  return on_ray(camera, motion, pose, camera.image_from_table<double>(centre_m));
}

}  // namespace

std::optional<data::Pose<>> face_outlined_like(const data::Body& body, const data::Camera& camera,
                                               const data::PoseMotion& motion,
                                               const data::Pose<>& pose, Side side) {
  const double h = body.half_thickness_m();
  const View view(camera, pose);
  // The minor axis over the major one of the ellipse that is outlined.
  const double share = view.facing + h / body.radius_m * view.leaning();
  if (!(share < 1.0)) return std::nullopt;
  return tilted(camera, motion, view, pose, share, side, pose.centre_m, h);
}

std::optional<data::Pose<>> outlined_like_face(const data::Body& body, const data::Camera& camera,
                                               const data::PoseMotion& motion,
                                               const data::Pose<>& pose) {
  const double h = body.half_thickness_m();
  const View view(camera, pose);
  if (!(view.facing > 0.0 && view.leaning() > 0.0)) return std::nullopt;
  // R cos t + h sin t = R facing
  const double wall_rad = std::atan2(h, body.radius_m);
  const double tilt_rad = wall_rad + std::acos(view.facing * std::cos(wall_rad));
  return tilted(camera, motion, view, pose, std::cos(tilt_rad), Side::same,
                pose.centre_m + h * view.near, 0.0);
}

}  // namespace trochoid::tracking
