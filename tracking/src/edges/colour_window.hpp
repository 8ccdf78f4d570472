#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>

#include "edges/edge_profile.hpp"
#include "trochoid/data/body.hpp"
#include "trochoid/data/camera.hpp"
#include "trochoid/data/pose.hpp"

namespace trochoid::tracking {

/// Blur that half-size colour planes, brought back to full size, have beyond that of the luma
/// [px^2]: pixels twice as wide, and the triangle between them.
inline constexpr double kColourBlur2Px2 = 4.0 / 12.0 - 1.0 / 12.0 + 4.0 / 6.0;
/// The same of the half-size planes as they are.
inline constexpr double kHalfSizeBlur2Px2 = 4.0 / 12.0 - 1.0 / 12.0;

/// How much of the way from the colour of the surroundings to that of the body a pixel shows that
/// the body covers in part: light mixes linearly, levels of colour do not, least of all beside
/// something much darker.
class ColourMixing {
 public:
  static constexpr int kParts = 32;
  /// As light does.
  ColourMixing();
  /// @param shown at shares 0, 1 / kParts .. 1 of the body; grows from 0 to 1.
  explicit ColourMixing(const std::array<double, kParts + 1>& shown) : shown_(shown) {}
  // Here, as they are asked for four times for each pixel.
  [[nodiscard]] double shown(double covered) const {
    const int part = part_of(covered);
    const auto k = static_cast<std::size_t>(part);
    return shown_[k] + (covered * kParts - part) * (shown_[k + 1] - shown_[k]);
  }
  /// Derivative of that.
  [[nodiscard]] double slope(double covered) const {
    const auto k = static_cast<std::size_t>(part_of(covered));
    return kParts * (shown_[k + 1] - shown_[k]);
  }

 private:
  [[nodiscard]] static int part_of(double covered) {
    return std::clamp(static_cast<int>(covered * kParts), 0, kParts - 1);
  }
  std::array<double, kParts + 1> shown_;
};

/// A picture of the colour difference in which a body stands out of its surroundings most, about 0
/// on these and about `body` on it; empty where there is none.
struct ColourWindow {
  LightWindow levels;        ///< of full size
  cv::Mat planes;            ///< as they are, CV_32FC1
  cv::Mat luma;              ///< as large as these, CV_32FC1
  cv::Point corner{};        ///< their first pixel, in pixels of the planes
  double neutral = 0.0;      ///< level of what has no colour
  double ground_luma = 1.0;  ///< of the surroundings
  /// Brightness of the surroundings, over that of all around, for which it is known how they mix.
  static constexpr std::array<double, 5> kShades{1.25, 1.0, 0.75, 0.5, 0.3};
  std::array<ColourMixing, kShades.size()> mixings{};
  double body = 0.0;
  bool plain = false;  ///< so much apart that a few pixels tell the body from its surroundings

  [[nodiscard]] bool empty() const { return levels.empty(); }
  /// How body and surroundings mix where the latter are so much brighter (> 1) or darker.
  [[nodiscard]] const ColourMixing& mixing_in(double shade) const;
  Eigen::Vector2d site_px = Eigen::Vector2d::Zero();  ///< OutlineView::chroma_site_px
  /// Where a pixel of the planes is in the picture.
  [[nodiscard]] Eigen::Vector2d place_of(int x, int y) const {
    return Eigen::Vector2d(2.0 * (corner.x + x) + 0.5, 2.0 * (corner.y + y) + 0.5) + site_px;
  }
  /// The same with `levels` blurred by a Gaussian.
  [[nodiscard]] ColourWindow blurred(double sigma_px) const {
    ColourWindow out = *this;
    out.levels = levels.blurred(sigma_px);
    return out;
  }
};

/// That of the body at `pose`. Shadows hardly change it, so it shows rims that the
/// luma loses. Empty where the colours are too much alike, or without chroma. `levels` are taken to
/// lie in the middle of the four pixels they belong to; other codings shift them by half a pixel.
[[nodiscard]] ColourWindow colour_window(const cv::Mat& luma, const cv::Mat& chroma,
                                         const cv::Rect& window, const data::Body& body,
                                         const data::Camera& camera, const data::Pose<>& pose);

/// Colour of a surface in any light: by how much cb and cr differ from neutral, over the luma.
struct Tint {
  double cb = 0.0, cr = 0.0;
};

/// Colours of the body at `pose` and of its surroundings; nothing without chroma or where they
/// cannot be seen.
struct Tints {
  Tint body, ground;
};
[[nodiscard]] std::optional<Tints> tints_of(const cv::Mat& luma, const cv::Mat& chroma,
                                            const data::Body& body, const data::Camera& camera,
                                            const data::Pose<>& pose);

/// Light of different colours mixes linearly in each primary, but not in the luma: how far in the
/// middle of an edge between these levels of light (0..255, outside the luma's transfer curve) the
/// light taken from the luma is off, over the difference of the levels.
[[nodiscard]] double mixing_error(const Tints& tints, double inner_light, double outer_light);

}  // namespace trochoid::tracking
