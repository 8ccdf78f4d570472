#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <utility>

#include "geometry/outline_samples.hpp"

namespace trochoid::tracking {

/// Linear-light copy of the part of a picture the fit looks at, so that a blurred edge is where its
/// two levels are mixed half and half. Outside the window samples are not available.
class LightWindow {
 public:
  LightWindow() = default;
  /// Copies `window` (clipped to the picture) of an 8-bit luma picture.
  LightWindow(const cv::Mat& luma, const cv::Rect& window, data::Transfer transfer);
  /// Any values that mix linearly across an edge, pixel (0, 0) of them at `origin`.
  LightWindow(cv::Mat values, const cv::Point& origin)
      : light_(std::move(values)), window_(origin, light_.size()) {}
  /// The same window blurred by a Gaussian.
  [[nodiscard]] LightWindow blurred(double sigma_px) const;
  [[nodiscard]] bool empty() const { return light_.empty(); }
  [[nodiscard]] const cv::Rect& window() const { return window_; }
  [[nodiscard]] float pixel(const cv::Point& p) const {
    return light_.ptr<float>(p.y - window_.y)[p.x - window_.x];
  }
  /// Bilinear sample; `holds` must be true for the point.
  [[nodiscard]] float at(float x_px, float y_px) const {
    const float x = x_px - static_cast<float>(window_.x), y = y_px - static_cast<float>(window_.y);
    // A point just before the last pixel may round to it.
    const int ix = std::min(static_cast<int>(x), window_.width - 2),
              iy = std::min(static_cast<int>(y), window_.height - 2);
    const float fx = x - static_cast<float>(ix), fy = y - static_cast<float>(iy);
    const float* upper = light_.ptr<float>(iy) + ix;
    const float* lower = upper + light_.step1();
    const float top = upper[0] + fx * (upper[1] - upper[0]);
    const float bottom = lower[0] + fx * (lower[1] - lower[0]);
    return top + fy * (bottom - top);
  }
  [[nodiscard]] bool holds(const Eigen::Vector2d& p) const {
    return p.x() >= window_.x && p.y() >= window_.y && p.x() < window_.x + window_.width - 1 &&
           p.y() < window_.y + window_.height - 1;
  }

 private:
  cv::Mat light_;  // CV_32FC1, 0..255
  cv::Rect window_;
};

/// The two sides of an edge of the body, as indices.
enum EdgeSide { kInside, kOutside };

/// Samples of picture and background plate across an outline, s [px] growing outwards along its
/// normal.
struct Profile {
  static constexpr int kMost = 96;
  int count = 0;
  bool plate = false;
  double shared = 2.0;  ///< samples per independent one
  int lines = 1;        ///< side by side
  std::array<float, kMost> s_px, light, background;

  /// Whether some of it is as bright as the picture can be.
  [[nodiscard]] bool clipped() const {
    constexpr float kClipped = 245.0f;
    return *std::max_element(light.begin(), light.begin() + count) > kClipped;
  }
  /// Of the sample nearest to s.
  [[nodiscard]] std::size_t nearest(double s) const {
    const auto* end = s_px.data() + count;
    const auto off = [s](float a) { return std::abs(static_cast<double>(a) - s); };
    return static_cast<std::size_t>(
        std::min_element(s_px.data(), end, [&](float a, float b) { return off(a) < off(b); }) -
        s_px.data());
  }
};

/// How far a profile goes to either side of a place beside the edge [px].
struct Extent {
  double inside_px, outside_px;
};

/// Samples every half pixel along the normal, between the pixels; false if that leaves the picture.
bool sample_profile(const LightWindow& picture, const LightWindow& plate,
                    const Eigen::Vector2d& at_px, const Eigen::Vector2d& normal_px,
                    const Extent& extent, Profile& profile);

/// The pixels of rows or columns in which an outline is crossed, as they are: crossings of all rows
/// and columns see every pixel beside the outline once, and none through its neighbours.
/// @param middle_px outwards of the outline: where s is 0.
bool read_pixels(const LightWindow& picture, const LightWindow& plate, const Crossings& crossings,
                 double middle_px, const Extent& extent, Profile& profile);

/// Whether a multiple of the plate explains the part of the profile beyond `from_px` better than a
/// constant does: not so where the body rests in the plate.
[[nodiscard]] bool plate_explains(const Profile& profile, double from_px);

}  // namespace trochoid::tracking
