#include "pose/edge_map.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "trochoid/data/angle.hpp"

namespace trochoid::tracking {
namespace {

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

// Changes below `soft` are shading, far above `sharp` a body against its background.
float strength_of(float change, float soft, float sharp) {
  const float over = std::max(0.0F, change - soft);
  return over / (over + sharp);
}

void raise(float& value, float to) {
  value = std::max(value, to);
}

}  // namespace

int EdgeMap::direction_of(double normal_x, double normal_y) {
  static const auto directions = [] {
    std::array<std::array<double, 2>, kDirections> units;
    for (size_t k = 0; k < kDirections; ++k) {
      const double angle = data::kPi * static_cast<double>(k) / kDirections;
      units[k] = {std::cos(angle), std::sin(angle)};
    }
    return units;
  }();
  int nearest = 0;
  double most = -1.0;
  for (size_t k = 0; k < kDirections; ++k) {
    const double along = std::abs(directions[k][0] * normal_x + directions[k][1] * normal_y);
    if (along > most) most = along, nearest = static_cast<int>(k);
  }
  return nearest;
}

EdgeMap::EdgeMap(const cv::Mat& luma, const cv::Mat& plate, const cv::Rect& window, int cell_px)
    : window_(window & cv::Rect({}, luma.size())), cell_px_(std::max(1, cell_px)) {
  const cv::Mat picture = logarithm(luma(window_));
  const Gradient g = gradient_of(picture);
  Gradient changed = g;
  if (!plate.empty()) changed = gradient_of(picture - logarithm(plate(window_)));
  const cv::Size cells((window_.width + cell_px_ - 1) / cell_px_,
                       (window_.height + cell_px_ - 1) / cell_px_);
  for (cv::Mat& s : own_) s = cv::Mat::zeros(cells, CV_32FC1);
  for (int y = 0; y < window_.height; ++y) {
    const auto *gx = g.x.ptr<float>(y), *gy = g.y.ptr<float>(y);
    const auto *cx = changed.x.ptr<float>(y), *cy = changed.y.ptr<float>(y);
    for (int x = 0; x < window_.width; ++x) {
      const float least = std::min(std::hypot(gx[x], gy[x]), std::hypot(cx[x], cy[x]));
      const float strength = strength_of(least, 0.02F, 0.06F);
      if (strength <= 0.0F) continue;
      raise(own_[static_cast<size_t>(direction_of(gx[x], gy[x]))].at<float>(y / cell_px_,
                                                                            x / cell_px_),
            strength);
    }
  }
  spread();
}

void EdgeMap::add_colours(const cv::Mat& chroma, const cv::Mat& plate) {
  constexpr float kSoftLevels = 2.0F, kSharpLevels = 4.0F;  // per pixel of the half-size planes
  const cv::Rect half = cv::Rect(cv::Point((window_.x + 1) / 2, (window_.y + 1) / 2),
                                 cv::Point(window_.br().x / 2, window_.br().y / 2)) &
                        cv::Rect({}, chroma.size());
  if (half.width < 3 || half.height < 3) return;
  for (const int plane : {0, 1}) {
    cv::Mat now, then;
    cv::extractChannel(chroma(half), now, plane);
    now.convertTo(now, CV_32F);
    const Gradient g = gradient_of(now);
    Gradient changed = g;
    if (!plate.empty()) {
      cv::extractChannel(plate(half), then, plane);
      then.convertTo(then, CV_32F);
      changed = gradient_of(now - then);
    }
    for (int y = 0; y < half.height; ++y) {
      const auto *gx = g.x.ptr<float>(y), *gy = g.y.ptr<float>(y);
      const auto *cx = changed.x.ptr<float>(y), *cy = changed.y.ptr<float>(y);
      for (int x = 0; x < half.width; ++x) {
        const float least = std::min(std::hypot(gx[x], gy[x]), std::hypot(cx[x], cy[x]));
        const float strength = strength_of(least, kSoftLevels, kSharpLevels);
        if (strength <= 0.0F) continue;
        cv::Mat& cells = own_[static_cast<size_t>(direction_of(gx[x], gy[x]))];
        for (int k = 0; k < 4; ++k)
          raise(cells.at<float>((2 * (half.y + y) + k / 2 - window_.y) / cell_px_,
                                (2 * (half.x + x) + k % 2 - window_.x) / cell_px_),
                strength);
      }
    }
  }
  spread();
}

void EdgeMap::spread() {
  // A normal between two directions, a point near the border of a cell.
  for (size_t i = 0; i < kDirections; ++i) {
    const cv::Mat& before = own_[(i + kDirections - 1) % kDirections];
    const cv::Mat& after = own_[(i + 1) % kDirections];
    strength_[i] = cv::max(own_[i], 0.7 * cv::max(before, after));
    cv::blur(strength_[i], strength_[i], {3, 3}, {-1, -1}, cv::BORDER_CONSTANT);
  }
}

}  // namespace trochoid::tracking
