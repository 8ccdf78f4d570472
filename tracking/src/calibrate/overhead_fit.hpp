#pragma once
#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "trochoid/data/body.hpp"
#include "trochoid/data/camera.hpp"
#include "trochoid/data/pose.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/tracking/outline_fit.hpp"

namespace trochoid::tracking {

/// A camera above the middle of the picture: logarithms of its scale on the floor [px/m] and of its
/// height [m], how far it is turned from looking straight down, about its own x and y [rad], and
/// its lens's k1.
using OverheadNumbers = Eigen::Vector<double, 5>;
enum OverheadNumber { kLogScale, kLogHeight, kTurnX, kTurnY, kBend };

[[nodiscard]] data::Camera overhead_camera(const OverheadNumbers& numbers, const cv::Size& size_px);

/// What is known of such a camera before anything is seen.
struct OverheadPrior {
  double log_focal = 0.0, focal_sigma = 0.0;  ///< focal length [px], its sigma relative
  std::optional<double> log_height;           ///< [m]
  double height_sigma = 0.02;                 ///< relative
  /// Of each turn and of k1; the outlines are not asked for them.
  double turn_sigma_rad = 0.0, bend_sigma = 0.0;
};

/// The outline of a body in one picture: edges, and a pose near the one that they show.
struct SeenOutline {
  data::Pose<> pose;
  std::vector<EdgePoint> edges;
};

struct OverheadFit {
  OverheadNumbers numbers;
  Eigen::Matrix<double, 5, 5> covariance;
  double rms_px = 0.0;  ///< of the edges about the outlines, outliers apart
  /// What outlines and focal length tell of the height, without what was known of it: logarithm
  /// [m], near `numbers`, and its sigma.
  double own_log_height = 0.0, own_height_sigma = 0.0;
};

/// The camera of a fit, with the covariance of its numbers.
[[nodiscard]] data::Camera overhead_camera(const OverheadFit& fit, const cv::Size& size_px);

/// Scale and height of an overhead camera from outlines of a body of known size, each with a pose
/// of its own (bundle adjustment [Triggs2000] with the poses eliminated, Tukey's weights). The
/// covariance takes the pictures for independent but not the edges of one, and allows for edges
/// that all lie farther out than they should, as models of edges do, and for the turns and the
/// lens.
/// @param body  a disc or ring of known size.  @param start  within a few per cent of the scale.
/// @throws NumericalError if the outlines determine no camera.
[[nodiscard]] OverheadFit fit_overhead(const data::Body& body, const data::Support& support,
                                       const cv::Size& size_px, const OverheadPrior& prior,
                                       const OverheadNumbers& start, std::vector<SeenOutline> seen);

}  // namespace trochoid::tracking
