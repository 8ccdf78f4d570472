#include "draw/render_picture.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "trochoid/data/error.hpp"

namespace trochoid::tools {
// Where a ray first meets the body, in body axes.
struct RayHit {
  double distance = std::numeric_limits<double>::infinity();
  Eigen::Vector3d at, normal;
};

namespace {

constexpr double kNone = std::numeric_limits<double>::infinity();
constexpr int kTextureSize = 512, kLampPoints = 48;

Eigen::Matrix3d attitude(const data::Pose<>& pose) {
  return (Eigen::AngleAxisd(pose.phi_rad, Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(pose.theta_rad, Eigen::Vector3d::UnitX()) *
          Eigen::AngleAxisd(pose.psi_rad, Eigen::Vector3d::UnitZ()))
      .toRotationMatrix();
}

// Lower end of the axle along the body's axis.
double axle_foot(const data::Body& body) {
  return body.l_m ? -*body.l_m : -body.half_thickness_m();
}

void meet_plane(const Eigen::Vector3d& from, const Eigen::Vector3d& along, double z, double inner,
                double outer, RayHit& hit) {
  if (along.z() == 0.0) return;
  const double t = (z - from.z()) / along.z();
  if (!(t > 0.0 && t < hit.distance)) return;
  const Eigen::Vector3d p = from + t * along;
  const double r2 = p.head<2>().squaredNorm();
  if (r2 > outer * outer || r2 < inner * inner) return;
  hit = {t, p, {0.0, 0.0, along.z() < 0.0 ? 1.0 : -1.0}};
}

// side +1: seen from outside, -1: the wall of a bore.
void meet_wall(const Eigen::Vector3d& from, const Eigen::Vector3d& along, double radius,
               double lowest, double highest, double side, RayHit& hit) {
  const double a = along.head<2>().squaredNorm(), b = from.head<2>().dot(along.head<2>());
  const double c = from.head<2>().squaredNorm() - radius * radius;
  const double root2 = b * b - a * c;
  if (a == 0.0 || root2 <= 0.0) return;
  for (const double sign : {-1.0, 1.0}) {
    const double t = (-b + sign * std::sqrt(root2)) / a;
    if (!(t > 0.0 && t < hit.distance)) continue;
    const Eigen::Vector3d p = from + t * along;
    if (p.z() < lowest || p.z() > highest) continue;
    const Eigen::Vector3d normal(side * p.x() / radius, side * p.y() / radius, 0.0);
    if (normal.dot(along) < 0.0) hit = {t, p, normal};
  }
}

RayHit meet_body(const data::Body& body, const Eigen::Vector3d& from,
                 const Eigen::Vector3d& along) {
  const double h = body.half_thickness_m();
  RayHit hit;
  for (const double z : {h, -h})
    meet_plane(from, along, z, body.inner_radius_m, body.radius_m, hit);
  meet_wall(from, along, body.radius_m, -h, h, 1.0, hit);
  if (body.inner_radius_m > 0.0) meet_wall(from, along, body.inner_radius_m, -h, h, -1.0, hit);
  if (body.axle_radius_m > 0.0) {
    const double top = h + body.axle_above_m;
    meet_wall(from, along, body.axle_radius_m, axle_foot(body), top, 1.0, hit);
    meet_plane(from, along, top, 0.0, body.axle_radius_m, hit);
  }
  return hit;
}

// Whether a ray that is not level meets what lies between two heights and two radii.
bool meets_tube(const Eigen::Vector3d& from, const Eigen::Vector3d& along, double lowest,
                double highest, double inner, double outer) {
  const double one = (lowest - from.z()) / along.z(), other = (highest - from.z()) / along.z();
  const double enters = std::max(0.0, std::min(one, other)), leaves = std::max(one, other);
  if (leaves <= 0.0 || leaves < enters) return false;  // equal where there is no thickness
  const Eigen::Vector2d way = along.head<2>(), start = from.head<2>();
  const double nearest =
      std::clamp(-start.dot(way) / std::max(way.squaredNorm(), 1e-300), enters, leaves);
  return (start + nearest * way).squaredNorm() < outer * outer &&
         std::max((start + enters * way).squaredNorm(), (start + leaves * way).squaredNorm()) >
             inner * inner;
}

// Whether a ray from outside meets the body anywhere.
bool hides(const data::Body& body, const Eigen::Vector3d& from, const Eigen::Vector3d& along) {
  if (along.z() == 0.0) return meet_body(body, from, along).distance < kNone;
  const double h = body.half_thickness_m();
  return meets_tube(from, along, -h, h, body.inner_radius_m, body.radius_m) ||
         (body.axle_radius_m > 0.0 &&
          meets_tube(from, along, axle_foot(body), h + body.axle_above_m, 0.0, body.axle_radius_m));
}

// How far the body reaches from its centre of mass.
double reach_of(const data::Body& body) {
  const double h = body.half_thickness_m();
  double reach = std::hypot(body.radius_m, h);
  if (body.axle_radius_m > 0.0)
    reach = std::max({reach, std::hypot(body.axle_radius_m, h + body.axle_above_m),
                      std::hypot(body.axle_radius_m, axle_foot(body))});
  return reach;
}

float to_srgb(float light) {
  return light <= 0.0031308F ? 12.92F * light : 1.055F * std::pow(light, 1.0F / 2.4F) - 0.055F;
}

// Noise on two scales, of standard deviation one, that continues across its borders.
cv::Mat make_texture(double grain_px, std::uint64_t seed) {
  cv::RNG random(seed);
  cv::Mat texture = cv::Mat::zeros(kTextureSize, kTextureSize, CV_32FC1);
  for (const double scale : {1.0, 0.3}) {
    cv::Mat noise(kTextureSize, kTextureSize, CV_32FC1), tiled;
    random.fill(noise, cv::RNG::NORMAL, 0.0, 1.0);
    cv::repeat(noise, 3, 3, tiled);
    const double sigma = std::max(0.7, scale * grain_px);
    cv::GaussianBlur(tiled, tiled, {}, sigma);
    cv::Mat middle = tiled(cv::Rect(kTextureSize, kTextureSize, kTextureSize, kTextureSize));
    cv::Scalar mean, deviation;
    cv::meanStdDev(middle, mean, deviation);
    texture += middle / (deviation[0] * std::numbers::sqrt2);
  }
  return texture;
}

}  // namespace

/// A pose as the rays need it.
struct PictureRenderer::Posed {
  Eigen::Matrix3d body_from_table;
  Eigen::Vector3d centre_m;
  std::vector<Eigen::Vector3d> lamp;  ///< in body axes
};

/// What a ray meets.
struct PictureRenderer::Seen {
  bool body = false;
  RayHit hit;             ///< in body axes
  Eigen::Vector3d along;  ///< of the ray, in body axes
};

PictureRenderer::PictureRenderer(data::Body body, data::Camera camera, RenderStyle style)
    : body_(std::move(body)),
      camera_(std::move(camera)),
      style_(style),
      reach_m_(reach_of(body_)),
      to_lamp_(style_.light.normalized()),
      camera_m_(camera_.position_m()) {
  if (!(body_.radius_m > 0.0))
    throw InputError("render: body.radius_m must be positive; a body without a shape has no look");
  if (camera_.width_px < 16 || camera_.height_px < 16)
    throw InputError("render: the camera says no picture size; give width and height");
  if (style_.samples < 1 || style_.times < 1)
    throw InputError("render: samples and times must be at least 1");
  const Eigen::Vector3d u = to_lamp_.unitOrthogonal(), v = to_lamp_.cross(u);
  constexpr double kGolden = 2.399963229728653;  // sunflower: even cover of a disc
  for (int i = 0; i < kLampPoints; ++i) {
    const double r = std::tan(style_.lamp_radius_rad) * std::sqrt((i + 0.5) / kLampPoints);
    lamp_.push_back(
        (to_lamp_ + r * std::cos(kGolden * i) * u + r * std::sin(kGolden * i) * v).normalized());
  }
  corners_.reserve(static_cast<std::size_t>(camera_.width_px + 1) * (camera_.height_px + 1));
  for (int y = 0; y <= camera_.height_px; ++y)
    for (int x = 0; x <= camera_.width_px; ++x)
      corners_.push_back(camera_.ray_from_image({x - 0.5, y - 0.5}).direction);
  texture_ = make_texture(8.0, style_.seed);
  draw_floor();
}

/// Between the corners of its pixel distortion is linear to far below what matters.
Eigen::Vector3d PictureRenderer::direction(double x_px, double y_px) const {
  const int ix = std::clamp(static_cast<int>(std::floor(x_px + 0.5)), 0, camera_.width_px - 1);
  const int iy = std::clamp(static_cast<int>(std::floor(y_px + 0.5)), 0, camera_.height_px - 1);
  const double fx = x_px + 0.5 - ix, fy = y_px + 0.5 - iy;
  const auto* above = corners_.data() + static_cast<std::size_t>(iy) * (camera_.width_px + 1) + ix;
  const auto* below = above + camera_.width_px + 1;
  return (1 - fy) * ((1 - fx) * above[0] + fx * above[1]) +
         fy * ((1 - fx) * below[0] + fx * below[1]);
}

/// Where the line of sight begins: at the camera, or where that has no centre above all there is.
Eigen::Vector3d PictureRenderer::eye(double x_px, double y_px) const {
  constexpr double kAbove_m = 100.0;
  if (camera_.projection == data::Camera::Projection::perspective) return camera_m_;
  const data::Ray ray = camera_.ray_from_image({x_px, y_px});
  return ray.origin_m - kAbove_m * ray.direction;
}

PictureRenderer::Seen PictureRenderer::trace(double x_px, double y_px, const Posed& body) const {
  const Eigen::Vector3d along = direction(x_px, y_px);
  const Eigen::Vector3d origin = eye(x_px, y_px);
  Seen seen;
  seen.along = body.body_from_table * along;
  const Eigen::Vector3d from = origin - body.centre_m;
  if (from.cross(along).squaredNorm() <= reach_m_ * reach_m_ * along.squaredNorm())
    seen.hit = meet_body(body_, body.body_from_table * from, seen.along);
  const double to_floor = along.z() < 0.0 ? -origin.z() / along.z() : kNone;
  seen.body = seen.hit.distance < to_floor;
  return seen;
}

/// Whether what is seen of the body belongs to a mark.
bool PictureRenderer::shows_mark(const Seen& seen) const {
  const double up = seen.hit.normal.z();
  if (std::abs(up) <= 0.5) return false;
  if (body_.border_radius_m > 0.0 && seen.hit.at.head<2>().norm() > body_.border_radius_m)
    return true;
  return std::any_of(body_.marks.begin(), body_.marks.end(), [&](const data::SpinMark& mark) {
    const Eigen::Vector2d centre(mark.distance_m * std::cos(mark.angle_rad),
                                 mark.distance_m * std::sin(mark.angle_rad));
    return (up > 0.0 ? mark.on_upper_face : mark.on_lower_face) &&
           (seen.hit.at.head<2>() - centre).norm() < mark.size_m;
  });
}

Eigen::Vector3f PictureRenderer::shade_body(const Seen& seen, const Posed& body) const {
  constexpr double kShininess = 60.0;
  const Eigen::Vector3f colour = shows_mark(seen) ? style_.mark : style_.body;
  const Eigen::Vector3d lamp = body.body_from_table * to_lamp_;
  const double facing = std::max(0.0, seen.hit.normal.dot(lamp));
  const Eigen::Vector3d half = (lamp - seen.along.normalized()).normalized();
  const double shine =
      style_.gloss * std::pow(std::max(0.0, half.dot(seen.hit.normal)), kShininess);
  const auto lit = static_cast<float>(style_.ambient + (1.0 - style_.ambient) * facing);
  return lit * colour + Eigen::Vector3f::Constant(static_cast<float>(shine));
}

// Whether the body hides any of the lamp from a point of the floor: a sphere around it would.
bool PictureRenderer::may_hide_lamp(const Eigen::Vector3d& to_body_m) const {
  const double far_m = to_body_m.norm();
  if (far_m <= reach_m_) return true;
  const double aside_rad = std::acos(std::clamp(to_body_m.dot(to_lamp_) / far_m, -1.0, 1.0));
  return aside_rad <= style_.lamp_radius_rad + std::asin(reach_m_ / far_m);
}

float PictureRenderer::floor_light(const Eigen::Vector3d& at_m, const Posed& body) const {
  if (!may_hide_lamp(body.centre_m - at_m)) return 1.0F;
  const Eigen::Vector3d from = body.body_from_table * (at_m - body.centre_m);
  int lit = 0;
  for (const Eigen::Vector3d& to : body.lamp) lit += hides(body_, from, to) ? 0 : 1;
  return static_cast<float>(style_.ambient + (1.0 - style_.ambient) * lit / kLampPoints);
}

Eigen::Vector3f PictureRenderer::floor_colour(const Eigen::Vector3d& at_m) const {
  const double scale = 8.0 / style_.texture_size_m;  // texture pixels per metre
  const double x = at_m.x() * scale, y = at_m.y() * scale;
  const double fx = x - std::floor(x), fy = y - std::floor(y);
  const auto wrap = [](double v) {
    return static_cast<int>(
        ((static_cast<std::int64_t>(std::floor(v)) % kTextureSize) + kTextureSize) % kTextureSize);
  };
  const int ix = wrap(x), iy = wrap(y), jx = (ix + 1) % kTextureSize, jy = (iy + 1) % kTextureSize;
  const double grain =
      (1 - fy) * ((1 - fx) * texture_.at<float>(iy, ix) + fx * texture_.at<float>(iy, jx)) +
      fy * ((1 - fx) * texture_.at<float>(jy, ix) + fx * texture_.at<float>(jy, jx));
  return style_.floor * static_cast<float>(std::max(0.05, 1.0 + style_.texture * grain));
}

void PictureRenderer::draw_floor() {
  constexpr int kAcross = 2;  // the texture is smooth on the scale of a pixel
  floor_.create(camera_.height_px, camera_.width_px, CV_32FC3);
  for (int y = 0; y < floor_.rows; ++y)
    for (int x = 0; x < floor_.cols; ++x) {
      Eigen::Vector3f sum = Eigen::Vector3f::Zero();
      for (int k = 0; k < kAcross * kAcross; ++k) {
        const double px = x + (k % kAcross + 0.5) / kAcross - 0.5;
        const double py = y + (k / kAcross + 0.5) / kAcross - 0.5;
        const Eigen::Vector3d along = direction(px, py);
        const Eigen::Vector3d origin = eye(px, py);
        if (along.z() < 0.0) sum += floor_colour(origin - origin.z() / along.z() * along);
      }
      sum /= static_cast<float>(kAcross * kAcross);
      floor_.at<cv::Vec3f>(y, x) = {sum.z(), sum.y(), sum.x()};
    }
}

/// Everything the body and its shadow may touch.
cv::Rect PictureRenderer::window(const data::Pose<>& pose) const {
  double left = 1e9, right = -1e9, top = 1e9, bottom = -1e9;
  const auto include = [&](const Eigen::Vector3d& centre) {
    for (const double dx : {-reach_m_, reach_m_})
      for (const double dy : {-reach_m_, reach_m_}) {
        const Eigen::Vector2d p =
            camera_.image_from_table<double>(centre + Eigen::Vector3d(dx, dy, 0.0));
        left = std::min(left, p.x()), right = std::max(right, p.x());
        top = std::min(top, p.y()), bottom = std::max(bottom, p.y());
      }
  };
  for (const double up : {-1.0, 1.0})
    include(pose.centre_m + Eigen::Vector3d(0.0, 0.0, up * reach_m_));
  if (style_.shadow)
    for (const Eigen::Vector3d& to : lamp_)
      if (to.z() > 0.1)
        for (const double up : {0.0, reach_m_}) {
          const double height = pose.centre_m.z() + up;
          include({pose.centre_m.x() - height * to.x() / to.z(),
                   pose.centre_m.y() - height * to.y() / to.z(), 0.0});
        }
  const auto clamp = [](double v) { return static_cast<int>(std::clamp(v, -1e5, 1e5)); };
  return cv::Rect(cv::Point(clamp(left) - 3, clamp(top) - 3),
                  cv::Point(clamp(right) + 4, clamp(bottom) + 4)) &
         cv::Rect(0, 0, camera_.width_px, camera_.height_px);
}

/// The surface a pixel's corner shows: 0 the floor, else a face or a wall (told apart by their
/// normals), a mark or an axle (by how near the axis it is).
int PictureRenderer::surface_at(double x_px, double y_px, const Posed& body) const {
  const Seen seen = trace(x_px, y_px, body);
  if (!seen.body) return 0;
  if (std::abs(seen.hit.normal.z()) > 0.5) return shows_mark(seen) ? 2 : 1;
  const bool axle =
      seen.hit.at.head<2>().norm() < 0.5 * body_.radius_m && body_.inner_radius_m <= 0.0;
  return axle ? 4 : 3;
}

/// Mean light of a pixel, from so many rays across it.
cv::Vec3f PictureRenderer::light_of_pixel(const cv::Point& pixel, int across,
                                          const Posed& body) const {
  Eigen::Vector3f colour = Eigen::Vector3f::Zero();
  int uncovered = 0;
  for (int k = 0; k < across * across; ++k) {
    const Seen seen = trace(pixel.x + (k % across + 0.5) / across - 0.5,
                            pixel.y + (k / across + 0.5) / across - 0.5, body);
    if (seen.body)
      colour += shade_body(seen, body);
    else
      ++uncovered;
  }
  const auto rays = static_cast<float>(across * across);
  colour /= rays;
  cv::Vec3f value(colour.z(), colour.y(), colour.x());
  if (uncovered == 0) return value;
  const Eigen::Vector3d along = direction(pixel.x, pixel.y);
  const Eigen::Vector3d origin = eye(pixel.x, pixel.y);
  const float lit =
      style_.shadow ? floor_light(origin - origin.z() / along.z() * along, body) : 1.0F;
  return value + floor_.at<cv::Vec3f>(pixel) * (lit * static_cast<float>(uncovered) / rays);
}

void PictureRenderer::draw_body(const data::Pose<>& pose, const cv::Rect& within, float share,
                                cv::Mat& sum) const {
  const cv::Rect box = window(pose) & within;
  if (box.empty()) return;
  Posed posed{attitude(pose).transpose(), pose.centre_m, {}};
  for (const Eigen::Vector3d& to : lamp_) posed.lamp.push_back(posed.body_from_table * to);
  cv::Mat surface(box.height + 1, box.width + 1, CV_32SC1);
  cv::parallel_for_(cv::Range(0, surface.rows), [&](const cv::Range& rows) {
    for (int y = rows.start; y < rows.end; ++y)
      for (int x = 0; x < surface.cols; ++x)
        surface.at<int>(y, x) = surface_at(box.x + x - 0.5, box.y + y - 0.5, posed);
  });
  // An edge passes through a pixel whose corners show several surfaces.
  cv::parallel_for_(cv::Range(0, box.height), [&](const cv::Range& rows) {
    for (int y = rows.start; y < rows.end; ++y)
      for (int x = 0; x < box.width; ++x) {
        const int kind = surface.at<int>(y, x);
        const bool even = kind == surface.at<int>(y, x + 1) && kind == surface.at<int>(y + 1, x) &&
                          kind == surface.at<int>(y + 1, x + 1);
        const cv::Point pixel(box.x + x, box.y + y);
        const cv::Vec3f value = light_of_pixel(pixel, even ? 1 : style_.samples, posed);
        sum.at<cv::Vec3f>(pixel) += share * (value - floor_.at<cv::Vec3f>(pixel));
      }
  });
}

void PictureRenderer::draw_exposed(const std::vector<data::Pose<>>& poses, const cv::Rect& within,
                                   cv::Mat& sum) const {
  const float share = 1.0F / static_cast<float>(std::max<std::size_t>(1, poses.size()));
  for (const data::Pose<>& pose : poses) draw_body(pose, within, share, sum);
}

cv::Mat PictureRenderer::light(const std::vector<data::Pose<>>& during_exposure) const {
  cv::Mat sum = floor_.clone();
  draw_exposed(during_exposure, {0, 0, sum.cols, sum.rows}, sum);
  return sum;
}

cv::Mat PictureRenderer::rolling_light(const ExposureOfRow& during_exposure) const {
  constexpr int kAtOnce = 2;  // rows that nothing tells apart
  cv::Mat sum = floor_.clone();
  for (int row = 0; row < sum.rows; row += kAtOnce) {
    const int rows = std::min(kAtOnce, sum.rows - row);
    draw_exposed(during_exposure(row + 0.5 * (rows - 1)), {0, row, sum.cols, rows}, sum);
  }
  return sum;
}

cv::Mat PictureRenderer::levels(const cv::Mat& light) const {
  cv::Mat out = light.clone();
  if (style_.blur_px > 0.0)
    cv::GaussianBlur(light, out, {}, style_.blur_px, style_.blur_px, cv::BORDER_REPLICATE);
  const bool linear = camera_.transfer == data::Transfer::linear;
  for (int y = 0; y < out.rows; ++y) {
    auto* row = out.ptr<float>(y);
    for (int i = 0; i < 3 * out.cols; ++i) {
      const float seen = std::clamp(row[i], 0.0F, 1.0F);
      row[i] = 255.0F * (linear ? seen : to_srgb(seen));
    }
  }
  return out;
}

cv::Mat PictureRenderer::picture(const cv::Mat& light, std::int64_t index) const {
  cv::Mat noise(light.size(), CV_32FC3), out;
  cv::RNG random(style_.seed * 0x9E3779B97F4A7C15ULL + static_cast<std::uint64_t>(index) + 1);
  random.fill(noise, cv::RNG::NORMAL, 0.0, style_.noise_levels);
  cv::Mat(levels(light) + noise).convertTo(out, CV_8UC3);
  return out;
}

}  // namespace trochoid::tools
