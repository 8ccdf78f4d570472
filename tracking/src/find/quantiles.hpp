#pragma once
#include <opencv2/core.hpp>
#include <vector>

namespace trochoid::tracking {

/// What the pixels of one plane of a picture show over time (CV_8UC1 all).
struct Quantiles {
  /// Number of samples they are taken of; fewer are repeated.
  static constexpr int kSamples = 16;

  cv::Mat median;
  cv::Mat spread;  ///< between the quartiles
  cv::Mat half;    ///< of the half of the samples that agree best
  cv::Mat range;   ///< of all samples

  /// Of that many samples (CV_8UC1, of one size), spread over those given.
  [[nodiscard]] static Quantiles of(const std::vector<cv::Mat>& samples);
  /// Which of `count` samples is the one of that number.
  [[nodiscard]] static std::size_t place_of(std::size_t number, std::size_t count) {
    return number * count / kSamples;
  }
  /// Standard deviation of one pixel over time [levels], at least 0.7.
  [[nodiscard]] double noise_levels() const;
};

}  // namespace trochoid::tracking
