#pragma once
#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "trochoid/tracking/outline_fit.hpp"

namespace trochoid::tracking {

/// The points centre + shape u, |u| = 1, with a symmetric positive definite shape: unlike axes and
/// an angle it has no singular point at the circle.
struct Ellipse {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d shape_px = Eigen::Matrix2d::Identity();

  static Ellipse from_axes(const Eigen::Vector2d& centre_px, double semi_major_px,
                           double semi_minor_px, double angle_rad);
  [[nodiscard]] double semi_major_px() const;
  [[nodiscard]] double semi_minor_px() const;
  [[nodiscard]] double angle_rad() const;  ///< of the major axis, image axes
};

/// How to look for a rim.
struct RimSearch {
  double reach_px = 4.0;  ///< edges are sought this far to both sides of the start
  double noise_levels = 2.0;
  /// Shape known from other frames, and how well; carries the fit where rim is hidden.
  std::optional<Eigen::Matrix2d> known_shape_px{};
  double known_shape_sigma_px = 0.1;
  /// Static background at the frame's brightness, or null: an edge it has too belongs to the scene
  /// (a bar in front of the body), unless most edges do (a body that turns in place).
  const cv::Mat* background = nullptr;
};

struct RimFit {
  Ellipse ellipse;
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Zero();  ///< of the centre
  double rms_px = 0.0;    ///< of the accepted edges about the ellipse
  double accepted = 0.0;  ///< fraction of the whole rim with an accepted edge
  std::vector<EdgePoint> edges{};
};

/// Sub-pixel ellipse through the strongest edges near `start`: half-level crossings between the
/// levels just inside and just outside, along normals; robust geometric fit (distance to the curve,
/// Tukey weights). The covariance counts neighbouring edges with correlated residuals once.
/// Its centre is the image of the rim's centre only without perspective and tilt: for a tilted
/// circle of radius R at distance D it is off by about (R/D)^2 D sin(2 theta)/2 along the line of
/// sight's slope (documented bias of a measurement without camera).
/// @returns nothing if too little of the rim shows an edge, or the fit leaves the neighbourhood.
[[nodiscard]] std::optional<RimFit> fit_rim(const cv::Mat& luma, const Ellipse& start,
                                            const RimSearch& search);

}  // namespace trochoid::tracking
