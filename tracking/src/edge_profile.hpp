#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <opencv2/core.hpp>

namespace trochoid::tracking {

/// Linear-light copy of the part of a picture the fit looks at, so that a blurred edge is where its
/// two levels are mixed half and half. Outside the window samples are not available.
class LightWindow {
 public:
  LightWindow() = default;
  /// Copies `window` (clipped to the picture) of an 8-bit luma picture.
  LightWindow(const cv::Mat& luma, const cv::Rect& window);
  /// The same window blurred by a Gaussian.
  [[nodiscard]] LightWindow blurred(double sigma_px) const;
  /// Brightens a plate by the median ratio to the picture: exposure drifts, lamps flicker.
  void scale_to(const LightWindow& picture);
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
  static constexpr int kMost = 96;
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
  /// Forgets the samples before s.
  void begin_at(double s);
  /// Forgets the samples beyond s.
  void end_at(double s) {
    while (count > 1 && s_px(count - 1) > s) --count;
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

/// What is assumed of the edge in a profile.
struct EdgeModel {
  double blur_px = 0.7;  ///< standard deviation of the Gaussian that blurs the step
  bool plate = false;    ///< the outer level is a multiple of the background plate
  bool slopes = false;   ///< both levels change linearly along the profile (shading, soft shadows)
};

/// A blurred step found in a profile.
struct ProfileEdge {
  double offset_px = 0.0;     ///< of the edge along the normal
  double variance_px2 = 0.0;  ///< from the residuals of the profile itself
  double information = 0.0;   ///< variance is noise^2 / information
  double contrast = 0.0;      ///< outer minus inner level at the edge
  double inner = 0.0;         ///< level of the body at the edge
  double noise = 0.0;         ///< rms residual of the profile
  double square = 0.0;        ///< squared residuals of independent samples, `freedom` of them
  double freedom = 1.0;
  double gain = 0.0;  ///< log-likelihood over "no edge here"
};

/// Fits the levels beside a blurred step and its position in `iterations` Gauss-Newton steps from
/// `start_px`; one step gives the best linear estimate, fit for averaging however noisy. False if
/// no edge is found within `reach_px` of the start.
bool fit_edge(const Profile& profile, const EdgeModel& model, double start_px, double reach_px,
              int iterations, ProfileEdge& edge);

/// Whether a multiple of the plate explains the part of the profile beyond `from_px` better than a
/// constant does: not so where the body rests in the plate.
[[nodiscard]] bool plate_explains(const Profile& profile, double from_px);

}  // namespace trochoid::tracking
