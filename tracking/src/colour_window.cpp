#include "colour_window.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "outline_samples.hpp"
#include "pose_motion.hpp"
#include "transfer_curve.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {
namespace {

struct Colour {
  Eigen::Vector2d middle;
  double scatter = 0.0;  // median deviation, the larger of both
};

// Points on circles about the axis in the plane of the near face.
std::vector<Eigen::Vector2d> circle_points(const data::Body& body, const data::Camera& camera,
                                           const data::Pose<>& pose,
                                           const std::vector<double>& radii_m) {
  constexpr int kAround = 24;
  const Eigen::Vector3d face = pose.centre_m + body.half_thickness_m() * axis_towards(camera, pose);
  const Eigen::Vector3d along = node_line(pose), across = ascent(pose);
  std::vector<Eigen::Vector2d> points;
  for (const double radius : radii_m)
    for (int i = 0; i < kAround; ++i) {
      const double a = 2.0 * std::numbers::pi * i / kAround;
      points.push_back(camera.image_from_table<double>(
          face + radius * (std::cos(a) * along + std::sin(a) * across)));
    }
  return points;
}

constexpr size_t kFewestPoints = 12;

bool colour_on_circles(const cv::Mat& chroma, const data::Body& body, const data::Camera& camera,
                       const data::Pose<>& pose, const std::vector<double>& radii_m,
                       Colour& colour) {
  std::vector<double> cb, cr;
  for (const Eigen::Vector2d& p : circle_points(body, camera, pose, radii_m)) {
    const int x = static_cast<int>(std::floor(0.5 * (p.x() + 0.5)));
    const int y = static_cast<int>(std::floor(0.5 * (p.y() + 0.5)));
    if (x < 0 || y < 0 || x >= chroma.cols || y >= chroma.rows) continue;
    const auto c = chroma.at<cv::Vec2b>(y, x);
    cb.push_back(c[0]);
    cr.push_back(c[1]);
  }
  if (cb.size() < kFewestPoints) return false;
  colour.middle = {data::median(cb), data::median(cr)};
  for (double& v : cb) v = std::abs(v - colour.middle.x());
  for (double& v : cr) v = std::abs(v - colour.middle.y());
  colour.scatter = std::max(data::median(cb), data::median(cr));
  return true;
}

bool luma_on_circles(const cv::Mat& luma, const data::Body& body, const data::Camera& camera,
                     const data::Pose<>& pose, const std::vector<double>& radii_m, double& level) {
  std::vector<double> levels;
  for (const Eigen::Vector2d& p : circle_points(body, camera, pose, radii_m)) {
    const int x = static_cast<int>(std::lround(p.x())), y = static_cast<int>(std::lround(p.y()));
    if (x >= 0 && y >= 0 && x < luma.cols && y < luma.rows)
      levels.push_back(luma.at<std::uint8_t>(y, x));
  }
  if (levels.size() < kFewestPoints) return false;
  level = data::median(levels);
  return true;
}

// Light of the three primaries of a surface with this luma, by BT.601.
std::array<double, 3> primaries(const Tint& tint, double luma) {
  const double cb = tint.cb * luma, cr = tint.cr * luma;
  return {light_of(luma + 1.402 * cr), light_of(luma - 0.344 * cb - 0.714 * cr),
          light_of(luma + 1.772 * cb)};
}

}  // namespace

std::optional<Tints> tints_of(const cv::Mat& luma, const cv::Mat& chroma, const data::Body& body,
                              const data::Camera& camera, const data::Pose<>& pose) {
  constexpr double kNeutral = 128.0, kDarkest = 10.0;
  if (chroma.empty()) return std::nullopt;
  const double R = body.radius_m, band = R - body.inner_radius_m;
  const auto tint_on = [&](const std::vector<double>& radii_m) -> std::optional<Tint> {
    Colour colour;
    double level = 0.0;
    if (!colour_on_circles(chroma, body, camera, pose, radii_m, colour) ||
        !luma_on_circles(luma, body, camera, pose, radii_m, level))
      return std::nullopt;
    level = std::max(level, kDarkest);
    return Tint{(colour.middle.x() - kNeutral) / level, (colour.middle.y() - kNeutral) / level};
  };
  const auto inside = tint_on({R - 0.35 * band, R - 0.6 * band});
  const auto outside = tint_on({1.4 * R, 1.7 * R});
  if (!inside || !outside) return std::nullopt;
  return Tints{*inside, *outside};
}

double mixing_error(const Tints& tints, double inner_light, double outer_light) {
  constexpr double kLeastStep = 1.0;
  const double inner = level_of(inner_light), outer = level_of(outer_light);
  const auto one = primaries(tints.body, inner), other = primaries(tints.ground, outer);
  double mixed = 0.0;
  constexpr std::array<double, 3> kShare{0.299, 0.587, 0.114};
  for (size_t k = 0; k < 3; ++k) mixed += kShare[k] * level_of(0.5 * (one[k] + other[k]));
  const double step = outer_light - inner_light;
  if (std::abs(step) < kLeastStep) return 0.0;
  return (light_of(mixed) - 0.5 * (inner_light + outer_light)) / step;
}

ColourWindow colour_window(const cv::Mat& chroma, const cv::Rect& window, const data::Body& body,
                           const data::Camera& camera, const data::Pose<>& pose) {
  constexpr double kLeastLevels = 5.0, kLeastRatio = 2.0, kPlainRatio = 4.0, kRounding = 0.5;
  if (chroma.empty()) return {};
  const double R = body.radius_m, band = R - body.inner_radius_m;
  Colour inside, outside;
  if (!colour_on_circles(chroma, body, camera, pose, {R - 0.35 * band, R - 0.6 * band}, inside) ||
      !colour_on_circles(chroma, body, camera, pose, {1.4 * R, 1.7 * R}, outside))
    return {};
  const Eigen::Vector2d apart = inside.middle - outside.middle;
  const double size = apart.norm();
  const double scatter = inside.scatter + outside.scatter;
  if (size < kLeastLevels || size < kLeastRatio * scatter) return {};
  const cv::Rect half =
      cv::Rect(window.x / 2 - 1, window.y / 2 - 1, window.width / 2 + 3, window.height / 2 + 3) &
      cv::Rect({}, chroma.size());
  if (half.width < 4 || half.height < 4) return {};
  cv::Mat values(half.size(), CV_32FC1);
  const Eigen::Vector2f to = (apart / size).cast<float>(), from = outside.middle.cast<float>();
  for (int y = 0; y < half.height; ++y) {
    const auto* in = chroma.ptr<cv::Vec2b>(half.y + y) + half.x;
    auto* out = values.ptr<float>(y);
    for (int x = 0; x < half.width; ++x)
      out[x] = to.x() * (static_cast<float>(in[x][0]) - from.x()) +
               to.y() * (static_cast<float>(in[x][1]) - from.y());
  }
  cv::resize(values, values, {}, 2.0, 2.0, cv::INTER_LINEAR);
  return {LightWindow(values, cv::Point(2 * half.x, 2 * half.y)), size,
          size > kPlainRatio * (scatter + kRounding)};
}

}  // namespace trochoid::tracking
