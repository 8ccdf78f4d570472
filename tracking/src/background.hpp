#pragma once
#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

namespace trochoid::tracking {

/// What the camera sees without the moving bodies, from frames spread over a recording.
class Background {
 public:
  /// Number of frames the estimate works with; fewer are repeated.
  static constexpr int kSamples = 16;

  /// Per-pixel median of the samples, each brought to the brightness of one of them. Where pixels
  /// changed and the median does not look like the static surroundings - a body rested or hovered
  /// there most of the time - samples that do take its place; where none does and the picture never
  /// settles, the surroundings themselves do.
  /// @param samples CV_8UC1 of one size, at least one.
  static Background from_samples(const std::vector<cv::Mat>& samples);

  [[nodiscard]] bool empty() const { return plate_.empty(); }
  [[nodiscard]] const cv::Mat& plate() const { return plate_; }
  /// Standard deviation of one pixel over time [levels], at least 0.7.
  [[nodiscard]] double noise_levels() const { return noise_; }
  /// Pixels that changed in some sample by more than noise (CV_8UC1, 0 or 255).
  [[nodiscard]] const cv::Mat& active() const { return active_; }
  /// Share of the picture that changes most of the time: near 0 for a camera on a stand.
  [[nodiscard]] double restless() const { return restless_; }

  /// Brightness of a frame relative to the plate: the median ratio over a coarse grid, so that a
  /// body, a hand or a shadow on less than half of the picture does not count.
  [[nodiscard]] double gain(const cv::Mat& luma) const;
  /// gain x plate within `box`, into an image of the full size (pixels outside are left alone).
  void scaled_into(cv::Mat& image, double gain, const cv::Rect& box) const;

 private:
  void uncover(const std::vector<cv::Mat>& samples, const cv::Mat& restless);

  cv::Mat plate_, active_;
  double noise_ = 1.0;
  double restless_ = 0.0;
};

}  // namespace trochoid::tracking
