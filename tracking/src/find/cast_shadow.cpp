#include "find/cast_shadow.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "edges/transfer_curve.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::tracking {

const std::vector<Eigen::Vector2d>& lamp_places() {
  static const std::vector<Eigen::Vector2d> all = [] {
    constexpr int kDirections = 24;
    std::vector<Eigen::Vector2d> lamps;
    for (const double aside : {0.3, 0.5, 0.8, 1.2, 1.8, 2.6})
      for (int i = 0; i < kDirections; ++i) {
        const double angle_rad = data::kTurn * i / kDirections;
        lamps.emplace_back(aside * std::cos(angle_rad), aside * std::sin(angle_rad));
      }
    return lamps;
  }();
  return all;
}

FloorDarkening::FloorDarkening(const cv::Mat& luma, const cv::Mat& plate, const data::Body& body,
                               const data::Pose<>& pose, const data::Camera& camera)
    : radius_m_(body.radius_m),
      bore_m_(body.inner_radius_m),
      half_thickness_m_(body.half_thickness_m()),
      centre_m_(pose.centre_m),
      axis_(data::symmetry_axis(pose.theta_rad, pose.phi_rad)) {
  look_around(luma, plate, camera);
}

namespace {

// Mean level of a pixel and its eight neighbours.
std::size_t level_at(const cv::Mat& levels, int x, int y) {
  int sum = 4;  // rounds
  for (int k = y - 1; k <= y + 1; ++k) {
    const unsigned char* row = levels.ptr(k) + x;
    sum += row[-1] + row[0] + row[1];
  }
  return static_cast<std::size_t>(sum / 9);
}

// The floor that a pixel shows; nothing where it shows none, or no ray leads to it.
std::optional<Eigen::Vector3d> floor_at(const data::Camera& camera, int x, int y) {
  try {
    return camera.table_from_image(Eigen::Vector2d(x, y));
  } catch (const NumericalError&) {
    return std::nullopt;
  }
}

}  // namespace

// Pixels of a box that the body covers, or nearly: blur, and light that codecs spread. The outline
// of a cylinder is the convex hull of its rims.
cv::Mat FloorDarkening::covered(const data::Camera& camera, const cv::Rect& box) const {
  constexpr int kRimPoints = 48, kBlur_px = 4;
  const Eigen::Vector3d level = axis_.unitOrthogonal(), steep = axis_.cross(level);
  std::vector<cv::Point> rims, hull;
  for (int i = 0; i < kRimPoints; ++i) {
    const double angle_rad = data::kTurn * i / kRimPoints;
    const Eigen::Vector3d at_m =
        centre_m_ + radius_m_ * (std::cos(angle_rad) * level + std::sin(angle_rad) * steep);
    for (const double along_m : {-half_thickness_m_, half_thickness_m_}) {
      const Eigen::Vector2d px = camera.image_from_table<double>(at_m + along_m * axis_);
      rims.emplace_back(static_cast<int>(std::lround(px.x())) - box.x,
                        static_cast<int>(std::lround(px.y())) - box.y);
    }
  }
  cv::convexHull(rims, hull);
  cv::Mat mask = cv::Mat::zeros(box.size(), CV_8U);
  cv::fillConvexPoly(mask, hull, 255);
  cv::polylines(mask, hull, true, 255, 2 * kBlur_px + 1);
  return mask;
}

void FloorDarkening::look_around(const cv::Mat& luma, const cv::Mat& plate,
                                 const data::Camera& camera) {
  constexpr double kReach_radii = 2.2, kSteps = 10.0;
  constexpr double kBrightest = -0.5;  // a reflection on the floor is none of it
  constexpr double kLeastLight = 0.5;  // of 255: a black floor shows no shadow
  const Eigen::Vector2d centre_px = camera.image_from_table<double>(centre_m_);
  const Eigen::Matrix2d J = camera.jacobian_px_per_m(centre_m_).leftCols<2>();
  const double radius_px = radius_m_ * std::sqrt(std::abs(J.determinant()));
  const int step_px = std::max(2, static_cast<int>(std::lround(radius_px / kSteps)));
  const int reach_px = static_cast<int>(kReach_radii * radius_px);
  const cv::Rect inside(1, 1, luma.cols - 2, luma.rows - 2);
  const cv::Rect box = inside & cv::Rect(static_cast<int>(centre_px.x()) - reach_px,
                                         static_cast<int>(centre_px.y()) - reach_px,
                                         2 * reach_px + 1, 2 * reach_px + 1);
  if (box.empty()) return;
  const cv::Mat body = covered(camera, box);
  const bool linear = camera.transfer == data::Transfer::linear;
  const auto light = [&](const cv::Mat& levels, int x, int y) {
    const std::size_t level = level_at(levels, x, y);
    return linear ? static_cast<double>(level) : light_of_levels()[level];
  };
  for (int y = box.y; y < box.y + box.height; y += step_px)
    for (int x = box.x; x < box.x + box.width; x += step_px) {
      const double floor = light(plate, x, y);
      if (floor < kLeastLight || body.at<unsigned char>(y - box.y, x - box.x) != 0) continue;
      const auto at_m = floor_at(camera, x, y);
      if (!at_m) continue;
      x_m_.push_back(at_m->x()), y_m_.push_back(at_m->y());
      darker_.push_back(std::max(kBrightest, 1.0 - light(luma, x, y) / floor));
    }
  if (darker_.empty()) return;
  const double mean =
      std::accumulate(darker_.begin(), darker_.end(), 0.0) / static_cast<double>(darker_.size());
  for (double& d : darker_) {
    d -= mean;
    square_ += d * d;
  }
}

bool FloorDarkening::Sums::tell() const {
  constexpr double kFewest = 4.0;
  return within >= kFewest && without >= kFewest;
}

namespace {

// Something that grows linearly along the floor.
struct OnFloor {
  double at_origin, per_x, per_y;
  [[nodiscard]] double at(double x_m, double y_m) const {
    return at_origin + per_x * x_m + per_y * y_m;
  }
};

// A plane across the axis of the body, as rays from the floor towards a lamp meet it: how far along
// they do, and where in it, from the axis.
struct Section {
  OnFloor along, level_m, steep_m;

  Section(const Eigen::Vector3d& middle_m, const Eigen::Vector3d& axis,
          const Eigen::Vector3d& towards) {
    const Eigen::Vector3d level = axis.unitOrthogonal(), steep = axis.cross(level);
    const double per_height = 1.0 / axis.dot(towards);
    along = {axis.dot(middle_m) * per_height, -axis.x() * per_height, -axis.y() * per_height};
    const auto part = [&](const Eigen::Vector3d& way) -> OnFloor {
      const double per_along = towards.dot(way);
      return {along.at_origin * per_along - middle_m.dot(way), along.per_x * per_along + way.x(),
              along.per_y * per_along + way.y()};
    };
    level_m = part(level), steep_m = part(steep);
  }
};

}  // namespace

FloorDarkening::Sums FloorDarkening::sums_under(const Eigen::Vector2d& lamp_aside) const {
  const Eigen::Vector3d towards(lamp_aside.x(), lamp_aside.y(), 1.0);
  // A face of the body or the middle between them stands in the way.
  const std::size_t count = darker_.size();
  std::vector<double> hidden(count, 0.0);
  const double least_m2 = bore_m_ * bore_m_, most_m2 = radius_m_ * radius_m_;
  for (const double off_m : {0.0, half_thickness_m_, -half_thickness_m_}) {
    const Section section(centre_m_ + off_m * axis_, axis_, towards);
    // Some ten million times a recording: without a branch, two points at a time.
    for (std::size_t i = 0; i < count; ++i) {
      const double level_m = section.level_m.at(x_m_[i], y_m_[i]);
      const double steep_m = section.steep_m.at(x_m_[i], y_m_[i]);
      const double off_m2 = level_m * level_m + steep_m * steep_m;
      const double ahead = section.along.at(x_m_[i], y_m_[i]) > 0.0 ? 1.0 : 0.0;
      const double outside_bore = off_m2 >= least_m2 ? ahead : 0.0;
      hidden[i] = std::max(hidden[i], off_m2 <= most_m2 ? outside_bore : 0.0);
    }
  }
  Sums sums;
  for (std::size_t i = 0; i < count; ++i)
    sums.within += hidden[i], sums.darker += hidden[i] * darker_[i];
  sums.without = static_cast<double>(count) - sums.within;
  return sums;
}

FloorDarkening::Shadow FloorDarkening::shadow_of(const Eigen::Vector2d& lamp_aside) const {
  const Sums sums = sums_under(lamp_aside);
  if (!sums.tell() || sums.darker <= 0.0) return {};
  constexpr double kLeastPart = 0.02;  // less is no shadow but how the picture was coded
  const double part = sums.darker / sums.square();
  return part > kLeastPart ? Shadow{part, part * sums.darker / square_} : Shadow{};
}

double FloorDarkening::agrees(const Lamp& lamp) const {
  const Sums sums = sums_under(lamp.aside);
  if (!sums.tell()) return 0.0;
  const double expected = lamp.part * lamp.part * sums.square();
  return 2.0 * (2.0 * lamp.part * sums.darker - expected) / (square_ + expected);
}

}  // namespace trochoid::tracking
