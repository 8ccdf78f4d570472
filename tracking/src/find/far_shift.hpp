#pragma once
#include <Eigen/Core>
#include <opencv2/core.hpp>

namespace trochoid::tracking {

/// Finds how far a part of a picture has gone since a known one was taken, by up to a fifth of its
/// size and to a pixel or so, where least squares, which finds hundredths of a pixel, would end in
/// a wrong place of the pattern.
class FarShift {
 public:
  /// @param part  of the known picture, CV_8UC1.
  explicit FarShift(const cv::Mat& part);

  /// Of a pattern with no two places alike, as grain or dirt: phase correlation, whose peak is
  /// sharp along stripes too. @param part  the same part of another picture.
  [[nodiscard]] Eigen::Vector2d by_phases(const cv::Mat& part) const;
  /// Of one with few waves, which leave most phases to noise: where it looks most alike.
  [[nodiscard]] Eigen::Vector2d by_likeness(const cv::Mat& part) const;

 private:
  cv::Mat pattern_, window_;
};

}  // namespace trochoid::tracking
