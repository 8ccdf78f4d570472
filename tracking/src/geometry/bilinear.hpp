#pragma once
#include <algorithm>
#include <cstdint>
#include <opencv2/core.hpp>

namespace trochoid::tracking {

/// @param image 8-bit, one channel @param x, y in px, 0 <= x < columns - 1, 0 <= y < rows - 1
/// @returns its level there, linear between the four pixels around
template <class Real>
Real bilinear(const cv::Mat& image, double x, double y) {
  const int ix = static_cast<int>(x), iy = static_cast<int>(y);
  const auto fx = static_cast<Real>(x - ix), fy = static_cast<Real>(y - iy);
  const std::uint8_t* p = image.ptr(iy) + ix;
  const std::uint8_t* q = p + image.step;
  return (1 - fy) * ((1 - fx) * p[0] + fx * p[1]) + fy * ((1 - fx) * q[0] + fx * q[1]);
}

/// The same of any point: of the nearest one that has four pixels around it.
template <class Real>
Real bilinear_inside(const cv::Mat& image, double x, double y) {
  constexpr double kWithin = 1.001;
  return bilinear<Real>(image, std::clamp(x, 0.0, image.cols - kWithin),
                        std::clamp(y, 0.0, image.rows - kWithin));
}

}  // namespace trochoid::tracking
