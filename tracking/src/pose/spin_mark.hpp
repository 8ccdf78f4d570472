#pragma once
#include <opencv2/core.hpp>
#include <optional>

#include "trochoid/data/body.hpp"
#include "trochoid/data/camera.hpp"
#include "trochoid/data/pose.hpp"

namespace trochoid::tracking {

/// Where the marks of a face are, as an angle about the axis.
struct MarkReading {
  double psi_rad = 0.0;    ///< spin, modulo a turn: the angle from the node line to body x
  double sigma_rad = 0.0;  ///< from the noise of the picture and the likeness of the marks alone
  double radius_px = 0.0;  ///< about how far from the axis the marks appear
  bool bright = false;     ///< the marks are brighter than their face
};

/// Reads the spin of a posed body from the known marks of the face towards the camera: the face is
/// unrolled about its axis with the camera, even light and light that changes across it are taken
/// out, and the marks, bright or dark, are sought at every angle, smeared as far as the body turned
/// while the shutter was open: the angle is that in the middle of the exposure. Nothing if that
/// face bears no mark, or if no angle stands out of all others.
[[nodiscard]] std::optional<MarkReading> read_marks(const cv::Mat& luma, const data::Body& body,
                                                    const data::Camera& camera,
                                                    const data::Pose<>& pose);

}  // namespace trochoid::tracking
