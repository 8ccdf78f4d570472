#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "find/background.hpp"
#include "trochoid/tracking/frame_source.hpp"

namespace trochoid::tracking {

/// Luma and colour at points spread over a body's face, as far as they lie in the picture.
struct FaceColours {
  static constexpr int kMost = 48;
  int count = 0;
  std::array<std::array<std::uint8_t, 3>, kMost> at{};
};

/// How a body where a fit puts it stands out against the background. A fit to floor texture or to
/// an occluder may have edges enough; it does not cover what the background fails to explain, and
/// its outline is not where that ends.
struct Contrast {
  double face = 0.0;      ///< fraction 0..1 of the face's points that differ from the background
  double outline = 0.0;   ///< fraction 0..1 of the outline across which the picture alone steps
  FaceColours colours{};  ///< what the face looks like there
};

/// A place on the outline: where, and the unit normal pointing away from the body.
struct Border {
  Eigen::Vector2d at_px, normal_px;
  double gap_px = 1.5;  ///< distance from the edge at which its two levels are pure
};

/// Compares face and outline of a body in a frame with the background at its brightness, by luma
/// or colour. Points outside the picture count as not seen.
[[nodiscard]] Contrast measure_contrast(const Frame& frame, const Plate& background,
                                        const std::vector<Eigen::Vector2d>& face_px,
                                        const std::vector<Border>& outline);

}  // namespace trochoid::tracking
