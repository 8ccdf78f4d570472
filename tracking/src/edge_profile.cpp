#include "edge_profile.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace trochoid::tracking {
namespace {

// Inverse of the transfer curve cameras apply (sRGB; BT.709 differs by less than 2 levels).
const std::array<float, 256>& light_of_luma() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> t{};
    for (int i = 0; i < 256; ++i) {
      const double v = i / 255.0;
      t[static_cast<size_t>(i)] = static_cast<float>(
          255.0 * (v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4)));
    }
    return t;
  }();
  return table;
}

}  // namespace

LightWindow::LightWindow(const cv::Mat& luma, const cv::Rect& window)
    : window_(window & cv::Rect(0, 0, luma.cols, luma.rows)) {
  if (window_.width < 2 || window_.height < 2) {
    window_ = {};
    return;
  }
  const auto& table = light_of_luma();
  light_.create(window_.height, window_.width, CV_32FC1);
  for (int y = 0; y < window_.height; ++y) {
    const auto* from = luma.ptr<unsigned char>(window_.y + y) + window_.x;
    auto* to = light_.ptr<float>(y);
    for (int x = 0; x < window_.width; ++x) to[x] = table[from[x]];
  }
}

LightWindow LightWindow::blurred(double sigma_px) const {
  LightWindow out;
  if (empty()) return out;
  out.window_ = window_;
  cv::GaussianBlur(light_, out.light_, {}, sigma_px, sigma_px, cv::BORDER_REPLICATE);
  return out;
}

float LightWindow::at(float x_px, float y_px) const {
  const float x = x_px - static_cast<float>(window_.x), y = y_px - static_cast<float>(window_.y);
  const int ix = static_cast<int>(x), iy = static_cast<int>(y);
  const float fx = x - static_cast<float>(ix), fy = y - static_cast<float>(iy);
  const float* upper = light_.ptr<float>(iy) + ix;
  const float* lower = upper + light_.step1();
  const float top = upper[0] + fx * (upper[1] - upper[0]);
  const float bottom = lower[0] + fx * (lower[1] - lower[0]);
  return top + fy * (bottom - top);
}

bool sample_profile(const LightWindow& picture, const LightWindow& plate,
                    const Eigen::Vector2d& at_px, const Eigen::Vector2d& normal_px,
                    double inside_px, double outside_px, Profile& profile) {
  const int in = static_cast<int>(inside_px / Profile::kStepPx);
  const int out = static_cast<int>(outside_px / Profile::kStepPx);
  profile.count = std::min(in + out + 1, Profile::kMost);
  profile.first_px = -Profile::kStepPx * static_cast<float>(in);
  profile.plate = !plate.empty();
  const Eigen::Vector2d first = at_px + profile.first_px * normal_px;
  const Eigen::Vector2d last = at_px + profile.s_px(profile.count - 1) * normal_px;
  if (!picture.holds(first) || !picture.holds(last)) return false;
  const Eigen::Vector2f from = first.cast<float>();
  const Eigen::Vector2f step = (Profile::kStepPx * normal_px).cast<float>();
  for (int i = 0; i < profile.count; ++i) {
    const float x = from.x() + static_cast<float>(i) * step.x();
    const float y = from.y() + static_cast<float>(i) * step.y();
    profile.light[i] = picture.at(x, y);
    if (profile.plate) profile.background[i] = plate.at(x, y);
  }
  return true;
}

bool plate_explains(const Profile& profile, double from_px) {
  if (!profile.plate) return false;
  double n = 0, b = 0, bb = 0, i = 0, ii = 0, bi = 0;
  for (int j = 0; j < profile.count; ++j) {
    if (profile.s_px(j) < from_px) continue;
    const double light = profile.light[j], ground = profile.background[j];
    n += 1, b += ground, bb += ground * ground, i += light, ii += light * light,
        bi += light * ground;
  }
  if (n < 2.0 || !(bb > 0.0)) return false;
  return ii - bi * bi / bb < ii - i * i / n;
}

}  // namespace trochoid::tracking
