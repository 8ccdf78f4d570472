#include "trochoid/tracking/calibration.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <opencv2/aruco/charuco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "calibrate/camera_error.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::tracking {
namespace {

void check(const BoardPattern& pattern) {
  if (pattern.columns < 3 || pattern.rows < 3)
    throw InputError(
        fmt::format("a board of {} x {}: give at least 3 x 3", pattern.columns, pattern.rows));
  if (!(pattern.square_m > 0.0))
    throw InputError(
        fmt::format("squares of {:g} m: those of a board need a size above 0", pattern.square_m));
  if (pattern.marker_m && !(*pattern.marker_m > 0.0 && *pattern.marker_m < pattern.square_m))
    throw InputError(fmt::format(
        "markers of {:g} m: those of a ChArUco board need a size above 0 and below that of its "
        "squares, {:g} m",
        *pattern.marker_m, pattern.square_m));
}

cv::Ptr<cv::aruco::Dictionary> dictionary_named(const std::string& name) {
  static const std::map<std::string, cv::aruco::PREDEFINED_DICTIONARY_NAME> kKnown{
      {"4X4_50", cv::aruco::DICT_4X4_50},   {"4X4_100", cv::aruco::DICT_4X4_100},
      {"4X4_250", cv::aruco::DICT_4X4_250}, {"5X5_50", cv::aruco::DICT_5X5_50},
      {"5X5_100", cv::aruco::DICT_5X5_100}, {"5X5_250", cv::aruco::DICT_5X5_250},
      {"6X6_50", cv::aruco::DICT_6X6_50},   {"6X6_100", cv::aruco::DICT_6X6_100},
      {"6X6_250", cv::aruco::DICT_6X6_250}, {"7X7_250", cv::aruco::DICT_7X7_250}};
  const auto found = kKnown.find(name);
  if (found != kKnown.end()) return cv::aruco::getPredefinedDictionary(found->second);
  std::string known;
  for (const auto& [each, value] : kKnown) known += (known.empty() ? "" : ", ") + each;
  throw InputError(fmt::format("no dictionary \"{}\"; known are {}", name, known));
}

// Board coordinates with the origin in the middle and y up: z then points out of the board.
Eigen::Vector2d centred(const cv::Point2d& corner, double width_m, double height_m) {
  return {corner.x - 0.5 * width_m, 0.5 * height_m - corner.y};
}

// Corners to where the edges around them cross, looking less than half way to the next corner.
void sharpen(const cv::Mat& luma, std::vector<cv::Point2f>& corners) {
  constexpr double kShare = 0.3, kSettled_px = 1e-4;
  constexpr int kSteps = 60;
  double nearest = 1e9;
  for (std::size_t i = 0; i < corners.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      nearest = std::min(nearest, cv::norm(corners[i] - corners[j]));
  const int half = std::clamp(static_cast<int>(kShare * nearest), 2, 12);
  cv::cornerSubPix(luma, corners, {half, half}, {-1, -1},
                   {cv::TermCriteria::EPS | cv::TermCriteria::COUNT, kSteps, kSettled_px});
}

}  // namespace

std::optional<cv::Size> chessboard_in(const cv::Mat& luma, const BoardPattern& pattern) {
  constexpr double kEnough_px = 320.0, kMore_px = 480.0;
  constexpr int kFewest = 3;
  const auto seen_at = [&luma](double longest_px, const cv::Size& size) {
    const double shrink = std::min(1.0, longest_px / std::max(luma.cols, luma.rows));
    cv::Mat small;
    cv::resize(luma, small, {}, shrink, shrink, cv::INTER_AREA);
    std::vector<cv::Point2f> corners;
    return cv::findChessboardCorners(small, size, corners);
  };
  const cv::Size wanted(pattern.columns, pattern.rows);
  for (const int more_columns : {0, -1, 1})
    for (const int more_rows : {0, -1, 1}) {
      const cv::Size size(wanted.width + more_columns, wanted.height + more_rows);
      if (std::min(size.width, size.height) < kFewest || !seen_at(kEnough_px, size)) continue;
      // Corners lost at a side for their smallness leave a board that seems to have fewer.
      return size.area() < wanted.area() && seen_at(kMore_px, wanted) ? wanted : size;
    }
  return std::nullopt;
}

namespace {

std::optional<BoardView> find_chessboard(const cv::Mat& luma, const BoardPattern& pattern) {
  const cv::Size size(pattern.columns, pattern.rows);
  std::vector<cv::Point2f> corners;
  // Where there is another board, its search takes half a minute.
  const auto seen = chessboard_in(luma, pattern);
  if (seen && *seen != size) return std::nullopt;
  if (!cv::findChessboardCorners(luma, size, corners) &&
      !cv::findChessboardCornersSB(luma, size, corners,
                                   cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_EXHAUSTIVE))
    return std::nullopt;
  sharpen(luma, corners);
  BoardView view;
  const double width = (size.width - 1) * pattern.square_m;
  const double height = (size.height - 1) * pattern.square_m;
  for (int i = 0; i < size.area(); ++i) {
    const cv::Point2d at(pattern.square_m * (i % size.width), pattern.square_m * (i / size.width));
    view.board_m.push_back(centred(at, width, height));
    const auto& p = corners[static_cast<std::size_t>(i)];
    view.image_px.emplace_back(p.x, p.y);
  }
  return view;
}

std::optional<BoardView> find_charuco(const cv::Mat& luma, const BoardPattern& pattern) {
  constexpr int kFewest = 6;
  const auto board = cv::aruco::CharucoBoard::create(
      pattern.columns, pattern.rows, static_cast<float>(pattern.square_m),
      static_cast<float>(*pattern.marker_m), dictionary_named(pattern.dictionary));
  std::vector<std::vector<cv::Point2f>> markers;
  std::vector<int> ids, corner_ids;
  cv::aruco::detectMarkers(luma, board->dictionary, markers, ids);
  if (ids.empty()) return std::nullopt;
  std::vector<cv::Point2f> corners;
  cv::aruco::interpolateCornersCharuco(markers, ids, luma, board, corners, corner_ids);
  if (static_cast<int>(corners.size()) < kFewest) return std::nullopt;
  sharpen(luma, corners);  // what comes out is half a pixel off in this version
  BoardView view;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    // This version's boards count y upwards from the lower edge.
    const cv::Point3f at = board->chessboardCorners[static_cast<std::size_t>(corner_ids[i])];
    view.board_m.emplace_back(at.x - 0.5 * pattern.columns * pattern.square_m,
                              at.y - 0.5 * pattern.rows * pattern.square_m);
    view.image_px.emplace_back(corners[i].x, corners[i].y);
  }
  return view;
}

cv::Mat matrix_of(const data::Camera& camera) {
  return (cv::Mat_<double>(3, 3) << camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0,
          1.0);
}

// A board seen from above has its x, y counted like the table's when seen in a mirror: all views of
// it must show the side whose z points to the camera, or the corners were found the wrong way
// round.
bool seen_from_above(const BoardView& view) {
  Eigen::Vector2d board_mean = Eigen::Vector2d::Zero(), image_mean = Eigen::Vector2d::Zero();
  const auto n = static_cast<double>(view.board_m.size());
  for (std::size_t i = 0; i < view.board_m.size(); ++i)
    board_mean += view.board_m[i] / n, image_mean += view.image_px[i] / n;
  Eigen::Matrix2d cross = Eigen::Matrix2d::Zero();
  for (std::size_t i = 0; i < view.board_m.size(); ++i)
    cross += (view.image_px[i] - image_mean) * (view.board_m[i] - board_mean).transpose();
  return cross.determinant() < 0.0;  // image y points down
}

// Across the line the points spread over less than a thousandth of what they do along it.
bool lie_on_a_line(const std::vector<Eigen::Vector2d>& points) {
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  for (const Eigen::Vector2d& point : points) {
    const Eigen::Vector2d off = point - points.front();
    scatter += off * off.transpose();
  }
  return scatter.determinant() <= 1e-6 * scatter.trace() * scatter.trace();
}

double rms_of(const Eigen::VectorXd& residuals) {
  return std::sqrt(residuals.squaredNorm() / static_cast<double>(residuals.size()));
}

}  // namespace

std::optional<BoardView> find_board(const cv::Mat& luma, const BoardPattern& pattern,
                                    const std::string& name) {
  check(pattern);
  auto view = pattern.marker_m ? find_charuco(luma, pattern) : find_chessboard(luma, pattern);
  if (!view) return std::nullopt;
  view->name = name;
  if (!seen_from_above(*view))
    for (Eigen::Vector2d& p : view->board_m) p.y() = -p.y();
  return view;
}

double set_floor(data::Camera& camera, const FloorPoints& points, double height_m,
                 double sigma_px) {
  const std::size_t n = points.table_m.size();
  if (n != points.image_px.size())
    throw InputError(
        fmt::format("{} points of the floor in the table's frame and {} in the picture; "
                    "they must go in pairs",
                    n, points.image_px.size()));
  if (n < 4) throw InputError(fmt::format("{} points of the floor; at least four are needed", n));
  std::vector<cv::Point3d> table;
  std::vector<cv::Point2d> image;
  for (std::size_t i = 0; i < n; ++i) {
    table.emplace_back(points.table_m[i].x(), points.table_m[i].y(), 0.0);
    image.emplace_back(points.image_px[i].x(), points.image_px[i].y());
  }
  if (lie_on_a_line(points.table_m))
    throw InputError(fmt::format("the {} points of the floor lie on one line", n));
  cv::Mat rotation, translation, attitude;
  const std::vector<double> distortion(camera.distortion.begin(), camera.distortion.end());
  bool solved = cv::solvePnP(table, image, matrix_of(camera), distortion, rotation, translation,
                             false, cv::SOLVEPNP_IPPE);
  if (solved)
    cv::solvePnPRefineLM(table, image, matrix_of(camera), distortion, rotation, translation);
  if (!solved)
    throw NumericalError(
        fmt::format("the {} points of the floor determine no pose of the camera", n));
  cv::Rodrigues(rotation, attitude);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      camera.camera_from_table(row, column) = attitude.at<double>(row, column);
    camera.camera_from_table_m[row] = translation.at<double>(row);
  }
  // What was z = 0 is height_m above the floor.
  camera.camera_from_table_m -= camera.camera_from_table.col(2) * height_m;
  if (camera.position_m().z() <= height_m)
    throw InputError(
        fmt::format("the {} points of the floor are seen from below; x, y and up must be "
                    "right-handed as seen by the camera",
                    n));
  const auto residuals = [&](const data::Camera& at) {
    return reprojection_px(at, points.table_m, points.image_px, 1.0, height_m);
  };
  add_pose_covariance(camera, residuals, sigma_px);
  return rms_of(residuals(camera));
}

namespace {

/// A circle of known radius as the camera sees it, in camera axes: centre [m] and the tilt of its
/// plane against square to the line of sight, whose normal is along (a, b, -1).
using SeenCircle = Eigen::Matrix<double, 5, 1>;  // centre (3), a, b

Eigen::Vector3d centre_of(const SeenCircle& circle) {
  return circle.head<3>();
}

Eigen::Vector3d normal_of(const SeenCircle& circle) {
  return Eigen::Vector3d(circle[3], circle[4], -1.0).normalized();
}

/// Rays through points of a rim, and how far a circle is from them.
struct RimRays {
  std::vector<Eigen::Vector3d> rays;  ///< camera axes, z = 1
  double radius_m, focal_px;

  RimRays(const data::Camera& camera, const std::vector<Eigen::Vector2d>& rim_px, double radius)
      : radius_m(radius), focal_px(camera.fx) {
    data::Camera bare = camera;
    bare.camera_from_table.setIdentity();
    bare.camera_from_table_m.setZero();
    for (const Eigen::Vector2d& p : rim_px) {
      const Eigen::Vector3d d = bare.ray_from_image(p).direction;
      rays.push_back(d / d.z());
    }
  }

  /// Square to the line of sight, at the distance its mean size says.
  [[nodiscard]] SeenCircle start() const {
    constexpr double kLeast_px = 1.0;
    const auto count = static_cast<double>(rays.size());
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (const auto& ray : rays) middle += ray / count;
    double size = 0.0;
    for (const auto& ray : rays) size += (ray - middle).norm() / count;
    if (!(size * focal_px > kLeast_px))
      throw InputError("the points of the rim lie within a pixel of each other");
    SeenCircle circle;
    circle << middle * (radius_m / size), 0.0, 0.0;
    return circle;
  }

  /// Distance of each point from the circle, in its plane [px].
  [[nodiscard]] Eigen::VectorXd residuals(const SeenCircle& circle) const {
    const Eigen::Vector3d centre = centre_of(circle), normal = normal_of(circle);
    Eigen::VectorXd r(static_cast<Eigen::Index>(rays.size()));
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const Eigen::Vector3d p = rays[i] * (centre.dot(normal) / rays[i].dot(normal));
      r[static_cast<Eigen::Index>(i)] = ((p - centre).norm() - radius_m) * focal_px / centre.z();
    }
    return r;
  }
};

/// Levenberg-Marquardt with differences. @throws NumericalError if it does not settle.
SeenCircle nearest_circle(const RimRays& rim, const SeenCircle& start) {
  constexpr int kIterations = 50;
  constexpr double kHopeless = 1e9;     // damping: no step, however small, gets nearer
  constexpr double kSettled_px = 1e-3;  // a last step that gained less has settled
  SeenCircle x = start;
  double damping = 1e-3, gained_px = 0.0;
  for (int i = 0; i < kIterations; ++i) {
    const Eigen::VectorXd r = rim.residuals(x);
    Eigen::MatrixXd J(r.size(), 5);
    for (int k = 0; k < 5; ++k) {
      SeenCircle moved = x;
      const double step = 1e-6 * (k < 3 ? x[2] : 1.0);
      moved[k] += step;
      J.col(k) = (rim.residuals(moved) - r) / step;
    }
    Eigen::Matrix<double, 5, 5> normal = J.transpose() * J;
    normal.diagonal() *= 1.0 + damping;
    const SeenCircle next = x - normal.ldlt().solve(J.transpose() * r);
    const bool better = next.allFinite() && rim.residuals(next).squaredNorm() < r.squaredNorm();
    damping *= better ? 0.3 : 10.0;
    if (better) {
      gained_px = rms_of(r) - rms_of(rim.residuals(next));
      x = next;
    }
    if (damping > kHopeless) return x;
  }
  if (!(gained_px < kSettled_px))
    throw NumericalError(fmt::format(
        "no circle settles on the {} points of the rim, {:.3g} px off after {} steps; are all of "
        "them on one rim, and is the camera that of their picture?",
        rim.rays.size(), rms_of(rim.residuals(x)), kIterations));
  return x;
}

/// Table frame with its origin below the centre, x to the right in the picture.
void set_frame(const SeenCircle& circle, double height_m, data::Camera& camera) {
  const Eigen::Vector3d up = normal_of(circle);
  const Eigen::Vector3d right =
      (Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitX().dot(up) * up).normalized();
  camera.camera_from_table.col(0) = right;
  camera.camera_from_table.col(1) = up.cross(right);
  camera.camera_from_table.col(2) = up;
  camera.camera_from_table_m = centre_of(circle) - height_m * up;
}

/// How far points are from the circle about the table's origin, and last how far x, which nothing
/// in the picture tells, points from where set_frame wants it.
Eigen::VectorXd off_circle_px(const data::Camera& camera,
                              const std::vector<Eigen::Vector2d>& rim_px, double radius_m,
                              double height_m) {
  constexpr double kExactly = 1e9;
  const double px_per_m = camera.fx / camera.depth_m({0.0, 0.0, height_m});
  Eigen::VectorXd out(static_cast<Eigen::Index>(rim_px.size()) + 1);
  for (std::size_t i = 0; i < rim_px.size(); ++i)
    out[static_cast<Eigen::Index>(i)] =
        px_per_m * (camera.table_from_image(rim_px[i], height_m).head<2>().norm() - radius_m);
  out[out.size() - 1] = kExactly * camera.camera_from_table(0, 1);
  return out;
}

}  // namespace

double set_floor_from_circle(data::Camera& camera, const std::vector<Eigen::Vector2d>& rim_px,
                             double radius_m, double height_m, double sigma_px) {
  constexpr std::size_t kFewest = 6;
  if (rim_px.size() < kFewest)
    throw InputError(
        fmt::format("{} points of the rim; at least {} are needed", rim_px.size(), kFewest));
  const RimRays rim(camera, rim_px, radius_m);
  const SeenCircle start = rim.start();
  // Edge on, the circle's plane passes through the camera: nothing tells how it is turned.
  if (lie_on_a_line(rim_px))
    throw InputError(fmt::format("the {} points of the rim lie on one line", rim_px.size()));
  const SeenCircle circle = nearest_circle(rim, start);
  if (!(centre_of(circle).z() > 0.0 && centre_of(circle).dot(normal_of(circle)) < 0.0))
    throw NumericalError(fmt::format(
        "the circle through the {} points of the rim is not seen from above: its "
        "centre lies {:.3g} m before the camera and {:.3g} m below it; check the "
        "points and the camera",
        rim_px.size(), centre_of(circle).z(), -centre_of(circle).dot(normal_of(circle))));
  set_frame(circle, height_m, camera);
  add_pose_covariance(
      camera, [&](const data::Camera& at) { return off_circle_px(at, rim_px, radius_m, height_m); },
      sigma_px);
  return rms_of(rim.residuals(circle));
}

}  // namespace trochoid::tracking
