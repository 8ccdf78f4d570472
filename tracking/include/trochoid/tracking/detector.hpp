#pragma once
#include <Eigen/Core>
#include <opencv2/core.hpp>

namespace trochoid::tracking {

/// Where a moving body roughly is in one frame: what the background does not explain.
struct Detection {
  Eigen::Vector2d centre_px;  ///< of the ellipse around the silhouette
  double semi_major_px = 0.0;
  double semi_minor_px = 0.0;
  double angle_rad = 0.0;  ///< of the major axis, image axes (x right, y down)
  cv::Rect box;            ///< of the silhouette
  double area_px2 = 0.0;   ///< pixels of the silhouette
  bool touches_border = false;
};

}  // namespace trochoid::tracking
