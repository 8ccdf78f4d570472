#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <opencv2/calib3d.hpp>

#include "calibrate/camera_error.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/quantile.hpp"
#include "trochoid/tracking/calibration.hpp"

namespace trochoid::tracking {
namespace {

constexpr std::size_t kFewestViews = 3;  // views that make a camera

/// Boards in parallel planes say the same about a camera, however often they are filmed
/// [Zhang2000].
std::size_t different_tilts(const std::vector<cv::Mat>& rotations) {
  constexpr double kApart_rad = 0.07;
  std::vector<Eigen::Vector3d> normals;
  for (const cv::Mat& rotation : rotations) {
    cv::Mat attitude;
    cv::Rodrigues(rotation, attitude);
    const Eigen::Vector3d normal(attitude.at<double>(0, 2), attitude.at<double>(1, 2),
                                 attitude.at<double>(2, 2));
    if (std::all_of(normals.begin(), normals.end(), [&](const Eigen::Vector3d& other) {
          return normal.cross(other).norm() > kApart_rad;
        }))
      normals.push_back(normal);
  }
  return normals.size();
}

// A view as the camera sees it from where OpenCV puts the camera, the board in units of `unit_m`.
PosedView posed(const data::Camera& camera, const BoardView& view, double unit_m,
                const cv::Mat& rotation, const cv::Mat& translation) {
  PosedView out{camera, [&view, unit_m](const data::Camera& at) {
                  return reprojection_px(at, view.board_m, view.image_px, 1.0 / unit_m, 0.0);
                }};
  cv::Mat attitude;
  cv::Rodrigues(rotation, attitude);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      out.camera.camera_from_table(row, column) = attitude.at<double>(row, column);
    out.camera.camera_from_table_m[row] = translation.at<double>(row);
  }
  return out;
}

// The farthest coordinate of a corner on the board.
double extent_m(const std::vector<BoardView>& views) {
  double most = 0.0;
  for (const BoardView& view : views)
    for (const Eigen::Vector2d& corner : view.board_m)
      most = std::max(most, corner.cwiseAbs().maxCoeff());
  return most > 0.0 ? most : 1.0;
}

// What OpenCV makes of all views, one as good as the other.
struct OpenCvCamera {
  cv::Mat matrix, distortion, view_rms;
  std::vector<cv::Mat> rotations, translations;
  double rms_px = 0.0, unit_m = 1.0;
};

// The optics do not depend on the size of the board; what OpenCV finds does, unless that is near
// one.
OpenCvCamera calibrated(const std::vector<BoardView>& views, const cv::Size& size_px) {
  OpenCvCamera found;
  found.unit_m = extent_m(views);
  std::vector<std::vector<cv::Point3f>> board;
  std::vector<std::vector<cv::Point2f>> image;
  for (const BoardView& view : views) {
    board.emplace_back();
    image.emplace_back();
    for (std::size_t i = 0; i < view.board_m.size(); ++i) {
      board.back().emplace_back(static_cast<float>(view.board_m[i].x() / found.unit_m),
                                static_cast<float>(view.board_m[i].y() / found.unit_m), 0.0F);
      image.back().emplace_back(static_cast<float>(view.image_px[i].x()),
                                static_cast<float>(view.image_px[i].y()));
    }
  }
  try {
    found.rms_px = cv::calibrateCamera(board, image, size_px, found.matrix, found.distortion,
                                       found.rotations, found.translations, cv::noArray(),
                                       cv::noArray(), found.view_rms, cv::CALIB_FIX_K3);
  } catch (const cv::Exception& error) {
    throw NumericalError(
        fmt::format("{} views of the board determine no camera ({})", views.size(), error.err));
  }
  return found;
}

data::Camera optics_of(const OpenCvCamera& found, const cv::Size& size_px) {
  data::Camera camera;
  camera.width_px = size_px.width;
  camera.height_px = size_px.height;
  camera.fx = found.matrix.at<double>(0, 0);
  camera.fy = found.matrix.at<double>(1, 1);
  camera.cx = found.matrix.at<double>(0, 2);
  camera.cy = found.matrix.at<double>(1, 2);
  for (int i = 0; i < 5; ++i)
    camera.distortion[static_cast<std::size_t>(i)] = found.distortion.at<double>(i);
  return camera;
}

void check_views(const std::vector<BoardView>& views) {
  if (views.size() < kFewestViews)
    throw InputError(
        fmt::format("{} views of the board; at least {} from different directions "
                    "make a camera",
                    views.size(), kFewestViews));
}

void check_tilts(const OpenCvCamera& found) {
  const std::size_t views = found.rotations.size(), different = different_tilts(found.rotations);
  if (different < kFewestViews)
    throw NumericalError(fmt::format(
        "{} views of the board are tilted in {} direction{} only and determine no camera; at least "
        "{} are needed, better ten, tilted by 20 to 40 degrees in different directions",
        views, different, different == 1 ? "" : "s", kFewestViews));
}

// The camera of all these views.
Calibration camera_of(const std::vector<BoardView>& views, const cv::Size& size_px) {
  check_views(views);
  const OpenCvCamera found = calibrated(views, size_px);
  check_tilts(found);
  Calibration out;
  data::Camera& camera = out.camera;
  camera = optics_of(found, size_px);
  out.rms_px = found.rms_px / std::sqrt(2.0);  // OpenCV counts both coordinates of a corner as one
  for (int i = 0; i < found.view_rms.rows; ++i)
    out.view_rms_px.push_back(found.view_rms.at<double>(i) / std::sqrt(2.0));
  std::vector<PosedView> seen;
  for (std::size_t i = 0; i < views.size(); ++i)
    seen.push_back(
        posed(camera, views[i], found.unit_m, found.rotations[i], found.translations[i]));
  set_optics_covariance(camera, seen);
  const Eigen::VectorXd sigma = camera.covariance.diagonal().cwiseSqrt();
  out.sigma_focal_px = std::max(sigma[0], sigma[1]);
  out.sigma_centre_px = std::max(sigma[2], sigma[3]);
  out.sigma_k1 = sigma[4];
  constexpr double kUseless = 0.2;
  // Boards that are never tilted let the focal length run away, with an error bar that is none.
  constexpr double kLongestLens = 1000.0;  // in pictures' widths: 0.06 degrees from side to side
  if (!(camera.fx > 0.0 && camera.fy > 0.0) || !(out.sigma_focal_px <= kUseless * camera.fx) ||
      !(std::max(camera.fx, camera.fy) < kLongestLens * size_px.width))
    throw NumericalError(
        fmt::format("{} views of the board determine no camera; tilt it by 20 to 40 degrees, in "
                    "different directions, in ten pictures or more",
                    views.size()));
  return out;
}

// Reprojection errors of all corners, summed: what calibrations with and without a view differ in.
double squares_px2(const std::vector<BoardView>& views, const Calibration& result) {
  double sum = 0.0;
  for (std::size_t i = 0; i < views.size(); ++i)
    sum += 2.0 * static_cast<double>(views[i].board_m.size()) * std::pow(result.view_rms_px[i], 2);
  return sum;
}

// How far each corner of a view lies from where the camera puts it, with the pose that fits best.
std::vector<double> distances_px(data::Camera camera, const BoardView& view) {
  (void)set_floor(camera, {view.board_m, view.image_px}, 0.0);
  std::vector<double> out;
  for (std::size_t i = 0; i < view.board_m.size(); ++i) {
    const Eigen::Vector3d corner(view.board_m[i].x(), view.board_m[i].y(), 0.0);
    out.push_back((camera.image_from_table<double>(corner) - view.image_px[i]).norm());
  }
  return out;
}

double rms_per_coordinate(const std::vector<double>& distances) {
  const double sum = std::inner_product(distances.begin(), distances.end(), distances.begin(), 0.0);
  return std::sqrt(0.5 * sum / static_cast<double>(distances.size()));
}

// A view, what the others make of it, and how far it pulls them.
struct Suspect {
  std::size_t view = 0;
  double pull = 0.0;      ///< in units of the others' scatter; 1 is expected
  double scatter_px = 0;  ///< of the others, per coordinate
  data::Camera camera;    ///< of the others
};

// With a view goes what its own corners and those of the others, bent towards it, are off by. For a
// view like the others that is their scatter again (the F test of a deletion); their median, since
// a second such view may be among them.
std::optional<Suspect> without(const std::vector<BoardView>& views, const cv::Size& size_px,
                               const Calibration& all, std::size_t view) {
  constexpr double kFinest_px = 0.02;  // nobody finds corners better
  constexpr double kPose = 6.0;        // numbers that go with a view
  std::vector<BoardView> others = views;
  others.erase(others.begin() + static_cast<std::ptrdiff_t>(view));
  try {
    const Calibration result = camera_of(others, size_px);
    Suspect out{.view = view, .camera = result.camera};
    out.scatter_px = std::max(data::median(result.view_rms_px), kFinest_px);
    const double spared = squares_px2(views, all) - squares_px2(others, result);
    const double own = 2.0 * static_cast<double>(views[view].board_m.size()) - kPose;
    out.pull = std::sqrt(std::max(0.0, spared / own)) / out.scatter_px;
    return out;
  } catch (const Error&) {
    return std::nullopt;  // no camera without it: nothing to say against it
  }
}

// The view that pulls hardest, of the few that fit worst: one calibration each.
std::optional<Suspect> hardest_pull(const std::vector<BoardView>& views, const cv::Size& size_px,
                                    const Calibration& all) {
  constexpr double kTooHard = 3.0;  // good views reach 1.5; boards bent by 1 mm in 160 reach 9
  constexpr std::size_t kTried = 3;
  if (views.size() <= kFewestViews) return std::nullopt;
  std::vector<std::size_t> worst(views.size());
  std::iota(worst.begin(), worst.end(), 0U);
  std::sort(worst.begin(), worst.end(),
            [&](auto a, auto b) { return all.view_rms_px[a] > all.view_rms_px[b]; });
  worst.resize(std::min(kTried, worst.size()));
  std::optional<Suspect> out;
  for (const std::size_t view : worst)
    if (auto each = without(views, size_px, all, view);
        each && each->pull > (out ? out->pull : kTooHard))
      out = std::move(each);
  return out;
}

// A few corners may be wrong where the rest of the view is right (glare, a finger): takes them out
// of it and returns where they were. Nothing if too many would have to go.
std::vector<Eigen::Vector2d> take_out_corners(BoardView& view, const Suspect& suspect) {
  constexpr double kMostShare = 0.1, kTooFar = 6.0;
  const auto most = static_cast<std::size_t>(kMostShare * static_cast<double>(view.board_m.size()));
  BoardView left = view;
  std::vector<Eigen::Vector2d> out;
  while (true) {
    const std::vector<double> off = distances_px(suspect.camera, left);
    const auto at = std::max_element(off.begin(), off.end()) - off.begin();
    if (off[static_cast<std::size_t>(at)] <= kTooFar * suspect.scatter_px) break;
    if (out.size() == most) return {};
    out.push_back(left.image_px[static_cast<std::size_t>(at)]);
    left.image_px.erase(left.image_px.begin() + at);
    left.board_m.erase(left.board_m.begin() + at);
  }
  view = std::move(left);
  return out;
}

// The suspect leaves `views`, or only a few corners of it do.
LeftOut leave_out(std::vector<BoardView>& views, const Suspect& suspect) {
  BoardView& view = views[suspect.view];
  LeftOut out;
  out.view = suspect.view;
  try {
    out.rms_px = rms_per_coordinate(distances_px(suspect.camera, view));
    out.corners_px = take_out_corners(view, suspect);
  } catch (const Error&) {  // corners so wrong that they have no pose
    out.rms_px = std::numeric_limits<double>::infinity();
  }
  if (out.corners_px.empty()) views.erase(views.begin() + static_cast<std::ptrdiff_t>(out.view));
  return out;
}

}  // namespace

Calibration calibrate(const std::vector<BoardView>& given, const cv::Size& size_px) {
  constexpr double kMostShare = 1.0 / 3.0;  // of the views: the others are the majority
  std::vector<BoardView> views = given;
  std::vector<std::size_t> number(given.size());  // of each view among those given
  std::iota(number.begin(), number.end(), 0U);
  Calibration result = camera_of(views, size_px);
  std::vector<LeftOut> left_out;
  const auto most = static_cast<std::size_t>(kMostShare * static_cast<double>(given.size()));
  while (left_out.size() < most) {
    const auto suspect = hardest_pull(views, size_px, result);
    if (!suspect) break;
    LeftOut out = leave_out(views, *suspect);
    out.view = number[suspect->view];
    if (out.corners_px.empty())
      number.erase(number.begin() + static_cast<std::ptrdiff_t>(suspect->view));
    left_out.push_back(std::move(out));
    result = camera_of(views, size_px);
  }
  std::vector<double> rms(given.size(), 0.0);
  for (const LeftOut& out : left_out) rms[out.view] = out.rms_px;
  for (std::size_t i = 0; i < views.size(); ++i) rms[number[i]] = result.view_rms_px[i];
  result.view_rms_px = std::move(rms);
  result.left_out = std::move(left_out);
  return result;
}

}  // namespace trochoid::tracking
