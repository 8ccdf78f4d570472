#pragma once
#include <opencv2/core.hpp>
#include <vector>

#include "trochoid/tracking/detector.hpp"

namespace trochoid::tracking {

/// A connected region that differs from the background.
struct Silhouette {
  Detection detection;
  std::vector<cv::Point2f> outline_px;  ///< its outer contour
  double solidity = 0.0;                ///< area inside the contour over that of its convex hull
  double ellipticity = 0.0;  ///< area of the hull over that of the ellipse with its moments
};

/// Regions of `luma` that differ from `background` (of the same brightness) by more than noise,
/// largest first. Works on a picture reduced to about 400 px across.
/// @param box part of the picture to look at; empty = all.
[[nodiscard]] std::vector<Silhouette> find_silhouettes(const cv::Mat& luma,
                                                       const cv::Mat& background,
                                                       double noise_levels, cv::Rect box = {});

/// Readings of the same regions as bodies, largest first: each region as it is, its part that
/// differs most (a body without the shadow it casts), and what is brighter than the background
/// alone (no shadow is).
[[nodiscard]] std::vector<Silhouette> find_bodies(const cv::Mat& luma, const cv::Mat& background,
                                                  double noise_levels, cv::Rect box = {});

}  // namespace trochoid::tracking
