#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <opencv2/core.hpp>
#include <utility>

namespace trochoid::tracking {

/// Linear-light copy of the part of a picture the fit looks at, so that a blurred edge is where its
/// two levels are mixed half and half. Outside the window samples are not available.
class LightWindow {
 public:
  LightWindow() = default;
  /// Copies `window` (clipped to the picture) of an 8-bit luma picture.
  LightWindow(const cv::Mat& luma, const cv::Rect& window);
  /// Any values that mix linearly across an edge, pixel (0, 0) of them at `origin`.
  LightWindow(cv::Mat values, const cv::Point& origin)
      : light_(std::move(values)), window_(origin, light_.size()) {}
  /// The same window blurred by a Gaussian.
  [[nodiscard]] LightWindow blurred(double sigma_px) const;
  [[nodiscard]] bool empty() const { return light_.empty(); }
  [[nodiscard]] const cv::Rect& window() const { return window_; }
  /// Bilinear sample; `holds` must be true for the point.
  [[nodiscard]] float at(float x_px, float y_px) const;
  [[nodiscard]] bool holds(const Eigen::Vector2d& p) const {
    return p.x() >= window_.x && p.y() >= window_.y && p.x() < window_.x + window_.width - 1 &&
           p.y() < window_.y + window_.height - 1;
  }

 private:
  cv::Mat light_;  // CV_32FC1, 0..255
  cv::Rect window_;
};

/// Samples of picture and background plate along the normal of an outline; s grows outwards.
struct Profile {
  static constexpr int kMost = 64;
  static constexpr float kStepPx = 0.5f;
  int count = 0;
  float first_px = 0.0f;  ///< s of sample 0
  bool plate = false;
  std::array<float, kMost> light, background;

  [[nodiscard]] float s_px(int i) const { return first_px + kStepPx * static_cast<float>(i); }
  /// Whether some of it is as bright as the picture can be.
  [[nodiscard]] bool clipped() const {
    constexpr float kClipped = 245.0f;
    return *std::max_element(light.begin(), light.begin() + count) > kClipped;
  }
  [[nodiscard]] double background_at(double s) const {
    const int i = static_cast<int>((s - first_px) / kStepPx);
    return background[static_cast<size_t>(i < 0 ? 0 : i >= count ? count - 1 : i)];
  }
};

/// Samples from -inside_px to +outside_px; false if that leaves the picture.
bool sample_profile(const LightWindow& picture, const LightWindow& plate,
                    const Eigen::Vector2d& at_px, const Eigen::Vector2d& normal_px,
                    double inside_px, double outside_px, Profile& profile);

/// Whether a multiple of the plate explains the part of the profile beyond `from_px` better than a
/// constant does: not so where the body rests in the plate.
[[nodiscard]] bool plate_explains(const Profile& profile, double from_px);

}  // namespace trochoid::tracking
