#include "colour_window.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "outline_samples.hpp"
#include "pose_motion.hpp"

namespace trochoid::tracking {
namespace {

struct Colour {
  Eigen::Vector2d middle;
  double scatter = 0.0;  // median deviation, the larger of both
};

double median_of(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Colour on circles about the axis in the plane of the near face.
bool colour_on_circles(const cv::Mat& chroma, const data::Body& body, const data::Camera& camera,
                       const data::Pose<>& pose, const std::vector<double>& radii_m,
                       Colour& colour) {
  constexpr int kAround = 24;
  constexpr size_t kFewest = 12;
  const Eigen::Vector3d face = pose.centre_m + body.half_thickness_m() * axis_towards(camera, pose);
  const Eigen::Vector3d along = node_line(pose), across = ascent(pose);
  std::vector<double> cb, cr;
  for (const double radius : radii_m)
    for (int i = 0; i < kAround; ++i) {
      const double a = 2.0 * std::numbers::pi * i / kAround;
      const Eigen::Vector2d p = camera.image_from_table<double>(
          face + radius * (std::cos(a) * along + std::sin(a) * across));
      const int x = static_cast<int>(std::floor(0.5 * (p.x() + 0.5)));
      const int y = static_cast<int>(std::floor(0.5 * (p.y() + 0.5)));
      if (x < 0 || y < 0 || x >= chroma.cols || y >= chroma.rows) continue;
      const auto c = chroma.at<cv::Vec2b>(y, x);
      cb.push_back(c[0]);
      cr.push_back(c[1]);
    }
  if (cb.size() < kFewest) return false;
  colour.middle = {median_of(cb), median_of(cr)};
  for (double& v : cb) v = std::abs(v - colour.middle.x());
  for (double& v : cr) v = std::abs(v - colour.middle.y());
  colour.scatter = std::max(median_of(cb), median_of(cr));
  return true;
}

}  // namespace

LightWindow colour_window(const cv::Mat& chroma, const cv::Rect& window, const data::Body& body,
                          const data::Camera& camera, const data::Pose<>& pose) {
  constexpr double kLeastLevels = 5.0, kLeastRatio = 2.0;
  if (chroma.empty()) return {};
  const double R = body.radius_m, band = R - body.inner_radius_m;
  Colour inside, outside;
  if (!colour_on_circles(chroma, body, camera, pose, {R - 0.35 * band, R - 0.6 * band}, inside) ||
      !colour_on_circles(chroma, body, camera, pose, {1.4 * R, 1.7 * R}, outside))
    return {};
  const Eigen::Vector2d apart = inside.middle - outside.middle;
  const double size = apart.norm();
  if (size < kLeastLevels || size < kLeastRatio * (inside.scatter + outside.scatter)) return {};
  const cv::Rect half =
      cv::Rect(window.x / 2 - 1, window.y / 2 - 1, window.width / 2 + 3, window.height / 2 + 3) &
      cv::Rect({}, chroma.size());
  if (half.width < 4 || half.height < 4) return {};
  cv::Mat values(half.size(), CV_32FC1);
  // About zero on the floor and `size` on the body.
  const Eigen::Vector2f to = (apart / size).cast<float>(), from = outside.middle.cast<float>();
  for (int y = 0; y < half.height; ++y) {
    const auto* in = chroma.ptr<cv::Vec2b>(half.y + y) + half.x;
    auto* out = values.ptr<float>(y);
    for (int x = 0; x < half.width; ++x)
      out[x] = to.x() * (static_cast<float>(in[x][0]) - from.x()) +
               to.y() * (static_cast<float>(in[x][1]) - from.y());
  }
  cv::resize(values, values, {}, 2.0, 2.0, cv::INTER_LINEAR);
  return LightWindow(values, cv::Point(2 * half.x, 2 * half.y));
}

}  // namespace trochoid::tracking
