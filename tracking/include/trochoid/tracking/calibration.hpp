#pragma once
#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "trochoid/data/camera.hpp"

namespace trochoid::tracking {

/// A calibration board: a chessboard with columns x rows inner corners, or a ChArUco board with
/// columns x rows squares of the OpenCV dictionary named.
struct BoardPattern {
  int columns = 9, rows = 6;
  double square_m = 0.02;
  std::optional<double> marker_m;  ///< side of the ArUco markers: makes it a ChArUco board
  std::string dictionary = "4X4_50";
};

/// Corners found in one picture and where they are on the board: x along the columns, y along the
/// rows, origin in the middle of the board [m].
struct BoardView {
  std::string name;
  std::vector<Eigen::Vector2d> image_px;
  std::vector<Eigen::Vector2d> board_m;
};

/// The corners of the board in a picture (CV_8UC1), or nothing if it is not to be seen whole (a
/// ChArUco board: at least 6 corners). Unlike OpenCV's, board y points up when x points right.
/// @throws InputError for a pattern that is no board.
[[nodiscard]] std::optional<BoardView> find_board(const cv::Mat& luma, const BoardPattern& pattern,
                                                  const std::string& name);

/// Inner corners along and across the chessboard in a picture (CV_8UC1), if it has as many as the
/// pattern or one more or less either way and is seen in the picture shrunk to a quick look.
[[nodiscard]] std::optional<cv::Size> chessboard_in(const cv::Mat& luma,
                                                    const BoardPattern& pattern);

/// A view that contradicts the others, or the few corners of it that do.
struct LeftOut {
  std::size_t view = 0;                     ///< of those given
  std::vector<Eigen::Vector2d> corners_px;  ///< where they were found; empty: the whole view
  double rms_px = 0.0;  ///< of the view, per coordinate, as the camera of the others sees it
};

/// A camera from several views of a board. Its table frame is not set yet; its covariance is that
/// of its optics.
struct Calibration {
  data::Camera camera;
  double rms_px = 0.0;              ///< reprojection error per coordinate, over all corners used
  std::vector<double> view_rms_px;  ///< of each view given, also of those left out
  std::vector<LeftOut> left_out;
  double sigma_focal_px = 0.0, sigma_centre_px = 0.0, sigma_k1 = 0.0;
};

/// Focal lengths, principal point and distortion k1, k2, p1, p2, [Zhang2000] as OpenCV does it.
/// Of four views or more, those that pull the camera three times as hard as the others' scatter
/// allows are left out, hardest first, a third of them at most; where a tenth of a view's corners
/// accounts for it, only these.
/// @throws InputError for fewer than three views; NumericalError if they do not determine a camera
/// (all seen from the same direction).
[[nodiscard]] Calibration calibrate(const std::vector<BoardView>& views, const cv::Size& size_px);

/// Where the floor is: points of it in the table frame [m] and in the picture [px].
struct FloorPoints {
  std::vector<Eigen::Vector2d> table_m;
  std::vector<Eigen::Vector2d> image_px;
};

/// Sets the table frame of a camera from at least four points of a plane `height_m` above the floor
/// (a board lying on it: its thickness), and completes the camera's covariance.
/// @param sigma_px  standard deviation of the points per coordinate, should they scatter by less.
/// @returns the rms reprojection error per coordinate [px].
/// @throws InputError for fewer than four points, points on a line or seen from below;
/// NumericalError if they determine no pose.
double set_floor(data::Camera& camera, const FloorPoints& points, double height_m,
                 double sigma_px = 0.0);

/// Sets the table frame from points of the rim [px] of a body of known radius that lies on its
/// face, `height_m` the height of that rim above the floor: origin under its centre, x to the right
/// in the picture. Of the two planes in which a circle can lie to look the same, the one the camera
/// looks at more squarely is taken. Completes the camera's covariance.
/// @param sigma_px  standard deviation of the points, should they scatter by less.
/// @returns the rms distance of the points from the circle [px].
/// @throws InputError for fewer than six points, all within a pixel or on a line; NumericalError if
/// no circle settles on them, or one that is not seen from above.
double set_floor_from_circle(data::Camera& camera, const std::vector<Eigen::Vector2d>& rim_px,
                             double radius_m, double height_m, double sigma_px = 0.0);

}  // namespace trochoid::tracking
