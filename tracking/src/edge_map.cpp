#include "edge_map.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

namespace trochoid::tracking {
namespace {

constexpr double kPi = std::numbers::pi;

// Logarithm of the luma; the offset keeps the noise of dark pixels from looking like edges.
cv::Mat logarithm(const cv::Mat& luma) {
  constexpr double kOffset = 10.0;
  static const cv::Mat table = [] {
    cv::Mat t(1, 256, CV_32FC1);
    for (int i = 0; i < 256; ++i) t.at<float>(i) = static_cast<float>(std::log(i + kOffset));
    return t;
  }();
  cv::Mat out;
  cv::LUT(luma, table, out);
  return out;
}

struct Gradient {
  cv::Mat x, y;
};

Gradient gradient_of(const cv::Mat& picture) {
  constexpr double kBlurPx = 1.0;
  cv::Mat smooth;
  cv::GaussianBlur(picture, smooth, {}, kBlurPx, kBlurPx, cv::BORDER_REPLICATE);
  Gradient g;
  cv::Sobel(smooth, g.x, CV_32F, 1, 0, 3, 0.125);
  cv::Sobel(smooth, g.y, CV_32F, 0, 1, 3, 0.125);
  return g;
}

// Changes below kSoft are shading, far above kSharp a body against its background.
float strength_of(float change) {
  constexpr float kSoft = 0.02F, kSharp = 0.06F;
  const float over = std::max(0.0F, change - kSoft);
  return over / (over + kSharp);
}

}  // namespace

int EdgeMap::direction_of(double normal_x, double normal_y) {
  const double turn = std::atan2(normal_y, normal_x) / kPi * kDirections;
  return ((static_cast<int>(std::lround(turn)) % kDirections) + kDirections) % kDirections;
}

EdgeMap::EdgeMap(const cv::Mat& luma, const cv::Mat& plate, const cv::Rect& window, int cell_px)
    : window_(window & cv::Rect({}, luma.size())), cell_px_(std::max(1, cell_px)) {
  const cv::Mat picture = logarithm(luma(window_));
  const Gradient g = gradient_of(picture);
  Gradient changed = g;
  if (!plate.empty()) changed = gradient_of(picture - logarithm(plate(window_)));
  const cv::Size cells((window_.width + cell_px_ - 1) / cell_px_,
                       (window_.height + cell_px_ - 1) / cell_px_);
  for (cv::Mat& s : strength_) s = cv::Mat::zeros(cells, CV_32FC1);
  for (int y = 0; y < window_.height; ++y) {
    const auto *gx = g.x.ptr<float>(y), *gy = g.y.ptr<float>(y);
    const auto *cx = changed.x.ptr<float>(y), *cy = changed.y.ptr<float>(y);
    for (int x = 0; x < window_.width; ++x) {
      const float least = std::min(std::hypot(gx[x], gy[x]), std::hypot(cx[x], cy[x]));
      const float strength = strength_of(least);
      if (strength <= 0.0F) continue;
      float& cell = strength_[static_cast<size_t>(direction_of(gx[x], gy[x]))].at<float>(
          y / cell_px_, x / cell_px_);
      cell = std::max(cell, strength);
    }
  }
  // A normal between two directions, a point near the border of a cell.
  std::array<cv::Mat, kDirections> wide;
  for (size_t i = 0; i < kDirections; ++i) {
    const cv::Mat& before = strength_[(i + kDirections - 1) % kDirections];
    const cv::Mat& after = strength_[(i + 1) % kDirections];
    wide[i] = cv::max(strength_[i], 0.7 * cv::max(before, after));
    cv::blur(wide[i], wide[i], {3, 3}, {-1, -1}, cv::BORDER_CONSTANT);
  }
  strength_ = wide;
}

}  // namespace trochoid::tracking
