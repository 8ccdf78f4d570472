#include "edges/colour_window.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "edges/transfer_curve.hpp"
#include "geometry/outline_samples.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/pose_motion.hpp"
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
      const double a = data::kTurn * i / kAround;
      points.push_back(camera.image_from_table<double>(
          face + radius * (std::cos(a) * along + std::sin(a) * across)));
    }
  return points;
}

// Radii on the face, and on the floor beside the body.
std::vector<double> circles_within(const data::Body& body) {
  const double band = body.radius_m - body.inner_radius_m;
  return {body.radius_m - 0.35 * band, body.radius_m - 0.6 * band};
}
std::vector<double> circles_around(const data::Body& body) {
  return {1.4 * body.radius_m, 1.7 * body.radius_m};
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

// Light of the three primaries, and what colour that is coded as, by BT.601.
struct Coded {
  double luma, cb, cr;
};

constexpr double kNeutral = 128.0;

Coded coded(double luma, const Eigen::Vector2d& chroma) {
  return {luma, chroma.x() - kNeutral, chroma.y() - kNeutral};
}

Coded in_shade(const Coded& colour, double shade) {
  return {shade * colour.luma, shade * colour.cb, shade * colour.cr};
}

Coded in_light(const Tint& tint, double luma) {
  return {luma, tint.cb * luma, tint.cr * luma};
}

std::array<double, 3> light_of_primaries(const Coded& colour) {
  return {light_of(colour.luma + 1.402 * colour.cr),
          light_of(colour.luma - 0.344 * colour.cb - 0.714 * colour.cr),
          light_of(colour.luma + 1.772 * colour.cb)};
}

Coded coded_as(const std::array<double, 3>& light) {
  const double red = level_of(light[0]), green = level_of(light[1]), blue = level_of(light[2]);
  const double luma = 0.299 * red + 0.587 * green + 0.114 * blue;
  return {luma, (blue - luma) / 1.772, (red - luma) / 1.402};
}

// Along the difference of the two colours, as far as the primaries can show these. Colours that on
// the way from one to the other go back or past it do not tell the share: as light, then.
ColourMixing mixing_between(const Coded& body, const Coded& ground) {
  const auto one = light_of_primaries(body), other = light_of_primaries(ground);
  const auto chroma_at = [&](double share) {
    std::array<double, 3> light{};
    for (size_t i = 0; i < 3; ++i) light[i] = share * one[i] + (1.0 - share) * other[i];
    const Coded mixed = coded_as(light);
    return Eigen::Vector2d(mixed.cb, mixed.cr);
  };
  const Eigen::Vector2d from = chroma_at(0.0), apart = chroma_at(1.0) - from;
  constexpr double kLeastApart = 2.0;
  if (apart.norm() < kLeastApart) return {};
  std::array<double, ColourMixing::kParts + 1> shown{};
  for (size_t k = 0; k < shown.size(); ++k) {
    const double share = static_cast<double>(k) / ColourMixing::kParts;
    shown[k] = apart.dot(chroma_at(share) - from) / apart.squaredNorm();
  }
  return std::is_sorted(shown.begin(), shown.end()) ? ColourMixing(shown) : ColourMixing();
}

}  // namespace

ColourMixing::ColourMixing() : shown_{} {
  for (int k = 0; k <= kParts; ++k) shown_[static_cast<size_t>(k)] = 1.0 / kParts * k;
}

const ColourMixing& ColourWindow::mixing_in(double shade) const {
  const auto* nearest = std::min_element(kShades.begin(), kShades.end(), [&](double a, double b) {
    return std::abs(a - shade) < std::abs(b - shade);
  });
  return mixings[static_cast<size_t>(nearest - kShades.begin())];
}

std::optional<Tints> tints_of(const cv::Mat& luma, const cv::Mat& chroma, const data::Body& body,
                              const data::Camera& camera, const data::Pose<>& pose) {
  constexpr double kDarkest = 10.0;
  if (chroma.empty()) return std::nullopt;
  const auto tint_on = [&](const std::vector<double>& radii_m) -> std::optional<Tint> {
    Colour colour;
    double level = 0.0;
    if (!colour_on_circles(chroma, body, camera, pose, radii_m, colour) ||
        !luma_on_circles(luma, body, camera, pose, radii_m, level))
      return std::nullopt;
    level = std::max(level, kDarkest);
    return Tint{(colour.middle.x() - kNeutral) / level, (colour.middle.y() - kNeutral) / level};
  };
  const auto inside = tint_on(circles_within(body));
  const auto outside = tint_on(circles_around(body));
  if (!inside || !outside) return std::nullopt;
  return Tints{*inside, *outside};
}

double mixing_error(const Tints& tints, double inner_light, double outer_light) {
  constexpr double kLeastStep = 1.0;
  const double inner = level_of(inner_light), outer = level_of(outer_light);
  const auto one = light_of_primaries(in_light(tints.body, inner)),
             other = light_of_primaries(in_light(tints.ground, outer));
  double mixed = 0.0;
  constexpr std::array<double, 3> kShare{0.299, 0.587, 0.114};
  for (size_t k = 0; k < 3; ++k) mixed += kShare[k] * level_of(0.5 * (one[k] + other[k]));
  const double step = outer_light - inner_light;
  if (std::abs(step) < kLeastStep) return 0.0;
  return (light_of(mixed) - 0.5 * (inner_light + outer_light)) / step;
}

ColourWindow colour_window(const cv::Mat& luma, const cv::Mat& chroma, const cv::Rect& window,
                           const data::Body& body, const data::Camera& camera,
                           const data::Pose<>& pose) {
  constexpr double kLeastLevels = 5.0, kLeastRatio = 2.0, kPlainRatio = 4.0, kRounding = 0.5;
  if (chroma.empty()) return {};
  Colour inside, outside;
  const std::vector<double> within = circles_within(body), around = circles_around(body);
  if (!colour_on_circles(chroma, body, camera, pose, within, inside) ||
      !colour_on_circles(chroma, body, camera, pose, around, outside))
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
  ColourWindow out;
  cv::Mat full;
  cv::resize(values, full, {}, 2.0, 2.0, cv::INTER_LINEAR);
  out.levels = LightWindow(full, cv::Point(2 * half.x, 2 * half.y));
  out.planes = values;
  const cv::Rect whole =
      cv::Rect(2 * half.x, 2 * half.y, 2 * half.width, 2 * half.height) & cv::Rect({}, luma.size());
  cv::resize(luma(whole), out.luma, half.size(), 0.0, 0.0, cv::INTER_AREA);
  out.luma.convertTo(out.luma, CV_32F);
  out.corner = half.tl();
  out.neutral = apart.dot(Eigen::Vector2d(kNeutral, kNeutral) - outside.middle) / size;
  out.body = size;
  out.plain = size > kPlainRatio * (scatter + kRounding);
  double inner = 0.0;
  if (!luma_on_circles(luma, body, camera, pose, within, inner) ||
      !luma_on_circles(luma, body, camera, pose, around, out.ground_luma) ||
      camera.transfer == data::Transfer::linear)
    return out;
  const Coded ground = coded(out.ground_luma, outside.middle);
  for (size_t k = 0; k < out.mixings.size(); ++k)
    out.mixings[k] =
        mixing_between(coded(inner, inside.middle), in_shade(ground, ColourWindow::kShades[k]));
  return out;
}

}  // namespace trochoid::tracking
