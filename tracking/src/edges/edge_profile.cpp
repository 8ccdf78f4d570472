#include "edges/edge_profile.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "edges/transfer_curve.hpp"

namespace trochoid::tracking {
namespace {

constexpr size_t at(int i) {
  return static_cast<size_t>(i);
}

}  // namespace

LightWindow::LightWindow(const cv::Mat& luma, const cv::Rect& window, data::Transfer transfer)
    : window_(window & cv::Rect(0, 0, luma.cols, luma.rows)) {
  if (window_.width < 2 || window_.height < 2) {
    window_ = {};
    return;
  }
  if (transfer == data::Transfer::linear) {
    luma(window_).convertTo(light_, CV_32FC1);
    return;
  }
  const auto& table = light_of_levels();
  light_.create(window_.height, window_.width, CV_32FC1);
  for (int y = 0; y < window_.height; ++y) {
    const auto* from = luma.ptr<unsigned char>(window_.y + y) + window_.x;
    auto* to = light_.ptr<float>(y);
    for (int x = 0; x < window_.width; ++x) to[x] = static_cast<float>(table[from[x]]);
  }
}

LightWindow LightWindow::blurred(double sigma_px) const {
  LightWindow out;
  if (empty()) return out;
  out.window_ = window_;
  cv::GaussianBlur(light_, out.light_, {}, sigma_px, sigma_px, cv::BORDER_REPLICATE);
  return out;
}

bool sample_profile(const LightWindow& picture, const LightWindow& plate,
                    const Eigen::Vector2d& at_px, const Eigen::Vector2d& normal_px,
                    const Extent& extent, Profile& profile) {
  constexpr float kStepPx = 0.5f;
  const int in = static_cast<int>(extent.inside_px / static_cast<double>(kStepPx));
  const int out = static_cast<int>(extent.outside_px / static_cast<double>(kStepPx));
  profile.count = std::min(in + out + 1, Profile::kMost);
  profile.plate = !plate.empty();
  profile.shared = 2.0;  // bilinear neighbours
  profile.lines = 1;
  for (int i = 0; i < profile.count; ++i)
    profile.s_px[at(i)] = kStepPx * static_cast<float>(i - in);
  const auto place = [&](int i) -> Eigen::Vector2d {
    return at_px + static_cast<double>(profile.s_px[at(i)]) * normal_px;
  };
  if (!picture.holds(place(0)) || !picture.holds(place(profile.count - 1))) return false;
  for (int i = 0; i < profile.count; ++i) {
    const Eigen::Vector2f p = place(i).cast<float>();
    profile.light[at(i)] = picture.at(p.x(), p.y());
    if (profile.plate) profile.background[at(i)] = plate.at(p.x(), p.y());
  }
  return true;
}

namespace {

// Appends the pixels of one row or column.
bool read_line(const LightWindow& picture, const LightWindow& plate, const Crossing& crossing,
               double middle_px, const Extent& extent, Profile& profile) {
  const bool row = crossing.row;
  const Eigen::Vector2d &p = crossing.image_px, &n = crossing.normal_px;
  const double slope = std::abs(row ? n.x() : n.y()), along = row ? n.y() : n.x();
  // Where an outline folds back its normals may cancel, and that of a body beside the lens is
  // nowhere: numbers that are no pixels.
  constexpr double kAcross = 0.05, kFar_px = 1e6;
  if (!(slope > kAcross && p.cwiseAbs().maxCoeff() < kFar_px)) return false;
  const int way = (row ? n.x() : n.y()) > 0.0 ? 1 : -1;
  const double from = way * (row ? p.x() : p.y());
  const int line = static_cast<int>(std::lround(row ? p.y() : p.x()));
  const int begin = static_cast<int>(std::ceil(from + (middle_px - extent.inside_px) / slope));
  int end = static_cast<int>(std::floor(from + (middle_px + extent.outside_px) / slope)) + 1;
  end = std::min(end, begin + Profile::kMost / Crossings::kMost);
  const auto place = [&](int k) {
    return row ? cv::Point(way * k, line) : cv::Point(line, way * k);
  };
  if (end <= begin || !picture.window().contains(place(begin)) ||
      !picture.window().contains(place(end - 1)))
    return false;
  // The outline bends away from the straight line.
  const double bend = 0.5 * crossing.curvature_per_px * along * along;
  for (int k = begin; k < end; ++k) {
    const cv::Point pixel = place(k);
    const double d = k - from;
    const size_t i = at(profile.count++);
    profile.s_px[i] = static_cast<float>(d * (slope + d * bend) - middle_px);
    profile.light[i] = picture.pixel(pixel);
    if (profile.plate) profile.background[i] = plate.pixel(pixel);
  }
  return true;
}

}  // namespace

bool read_pixels(const LightWindow& picture, const LightWindow& plate, const Crossings& crossings,
                 double middle_px, const Extent& extent, Profile& profile) {
  profile.count = 0;
  profile.plate = !plate.empty();
  profile.shared = 1.0;
  profile.lines = crossings.count;
  for (int i = 0; i < crossings.count; ++i)
    if (!read_line(picture, plate, crossings.at[at(i)], middle_px, extent, profile)) return false;
  return profile.count > 0;
}

bool plate_explains(const Profile& profile, double from_px) {
  if (!profile.plate) return false;
  double n = 0, b = 0, bb = 0, i = 0, ii = 0, bi = 0;
  for (int j = 0; j < profile.count; ++j) {
    if (profile.s_px[at(j)] < from_px) continue;
    const double light = profile.light[at(j)], ground = profile.background[at(j)];
    n += 1, b += ground, bb += ground * ground, i += light, ii += light * light,
        bi += light * ground;
  }
  if (n < 2.0 || !(bb > 0.0)) return false;
  return ii - bi * bi / bb < ii - i * i / n;
}

}  // namespace trochoid::tracking
