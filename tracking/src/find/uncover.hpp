#pragma once
#include <opencv2/core.hpp>
#include <vector>

#include "find/quantiles.hpp"

// The floor where a body rested or hovered.
namespace trochoid::tracking {

/// Pixels of a plane that changed (CV_8UC1, 0 or 255).
struct Changes {
  cv::Mat ever;    ///< in some sample
  cv::Mat often;   ///< in a quarter of the samples, and back
  cv::Mat always;  ///< so that no half of the samples agrees

  /// @param noise as Quantiles::noise_levels() has it, @param least levels that count as a change.
  [[nodiscard]] static Changes of(const Quantiles& quantiles, double noise, double least);
  /// In this plane or in another of the same size.
  [[nodiscard]] Changes operator|(const Changes& other) const;
};

/// Pixels above this value, 0 or 255.
[[nodiscard]] cv::Mat above(const cv::Mat& image, double threshold);

/// Whether enough of a picture never changed that something in it is known to be static.
[[nodiscard]] bool mostly_static(const cv::Mat& active);

/// Replaces, in the median of one plane's samples, what does not look like the static surroundings
/// by what samples that do look like them show, or, where nothing settles, by the surroundings
/// themselves. A plain body that wobbles in one place looks as still in the middle, which it never
/// leaves, as a floor.
void uncover(cv::Mat& plane, const std::vector<cv::Mat>& samples, const Changes& changes,
             double noise);

}  // namespace trochoid::tracking
