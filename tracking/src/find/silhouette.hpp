#pragma once
#include <opencv2/core.hpp>
#include <vector>

#include "find/background.hpp"
#include "find/palette.hpp"
#include "trochoid/tracking/detector.hpp"
#include "trochoid/tracking/frame_source.hpp"

namespace trochoid::tracking {

/// A connected region that differs from the background.
struct Silhouette {
  Detection detection;
  double solidity = 0.0;     ///< area inside the contour over that of its convex hull
  double ellipticity = 0.0;  ///< area of the hull over that of the ellipse with its moments
};

/// Regions of a picture that differ from the background (of the same brightness) in luma or colour
/// by more than noise, largest first. Works on a picture whose longer side is reduced by a whole
/// number to 320 px or more, 639 at most.
/// @param box part of the picture to look at; empty = all.
[[nodiscard]] std::vector<Silhouette> find_silhouettes(const Frame& frame, const Plate& background,
                                                       cv::Rect box = {});

/// Readings of the same regions as bodies, largest first: each region as it is, its part that
/// differs most (a body without the shadow it casts), what is brighter than the background alone,
/// and what has another colour than the background in any light (no shadow is either).
[[nodiscard]] std::vector<Silhouette> find_bodies(const Frame& frame, const Plate& background,
                                                  cv::Rect box = {});

/// What differs from the background and has a body's own colours: each region, and the larger ones
/// together, as where a bar lies across the body. Tells it from a hand that touches it.
[[nodiscard]] std::vector<Silhouette> find_coloured_like(const Palette& body, double gain,
                                                         const Frame& frame,
                                                         const Plate& background, cv::Rect box);

}  // namespace trochoid::tracking
