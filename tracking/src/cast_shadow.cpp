#include "cast_shadow.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "transfer_curve.hpp"

namespace trochoid::tracking {

const std::vector<Eigen::Vector2d>& all_round() {
  static const std::vector<Eigen::Vector2d> all = [] {
    constexpr int kDirections = 24;
    std::vector<Eigen::Vector2d> lamps;
    for (const double aside : {0.3, 0.5, 0.8, 1.2, 1.8, 2.6})
      for (int i = 0; i < kDirections; ++i) {
        const double angle_rad = 2.0 * std::numbers::pi * i / kDirections;
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
      axis_(data::symmetry_axis(pose.theta_rad, pose.phi_rad)),
      middles_m_{pose.centre_m, pose.centre_m + body.half_thickness_m() * axis_,
                 pose.centre_m - body.half_thickness_m() * axis_} {
  look_around(luma, plate, camera);
}

void FloorDarkening::look_around(const cv::Mat& luma, const cv::Mat& plate,
                                 const data::Camera& camera) {
  constexpr double kReach_radii = 2.2, kSteps = 10.0;
  constexpr double kBlur_px = 4.0;     // of the outline, and light that codecs spread
  constexpr double kBrightest = -0.5;  // a reflection on the floor is none of it
  constexpr double kLeastLight = 0.5;  // of 255: a black floor shows no shadow
  const Eigen::Vector2d centre_px = camera.image_from_table<double>(middles_m_[0]);
  const Eigen::Matrix2d J = camera.jacobian_px_per_m(middles_m_[0]).leftCols<2>();
  const double px_per_m = std::sqrt(std::abs(J.determinant()));
  const double radius_px = px_per_m * radius_m_;
  const int step_px = std::max(2, static_cast<int>(radius_px / kSteps));
  const int reach_px = static_cast<int>(kReach_radii * radius_px);
  const cv::Rect box =
      cv::Rect(static_cast<int>(centre_px.x()) - reach_px,
               static_cast<int>(centre_px.y()) - reach_px, 2 * reach_px + 1, 2 * reach_px + 1) &
      cv::Rect({}, luma.size());
  if (box.empty()) return;
  cv::Mat here, without;
  cv::blur(luma(box), here, {3, 3});
  cv::blur(plate(box), without, {3, 3});
  const bool linear = camera.transfer == data::Transfer::linear;
  const auto light = [&](const cv::Mat& levels, int x, int y) {
    const double level = levels.ptr(y)[x];
    return linear ? level : light_of(level);
  };
  for (int y = 0; y < box.height; y += step_px)
    for (int x = 0; x < box.width; x += step_px) {
      const double floor = light(without, x, y);
      if (floor < kLeastLight) continue;
      const data::Ray ray = camera.ray_from_image({box.x + x, box.y + y});
      if (!(ray.direction.z() < 0.0)) continue;
      const Eigen::Vector3d at_m =
          ray.origin_m - ray.origin_m.z() / ray.direction.z() * ray.direction;
      if (meets(at_m, -ray.direction, 0.0, radius_m_ + kBlur_px / px_per_m)) continue;
      at_m_.push_back(at_m);
      darker_.push_back(std::max(kBrightest, 1.0 - light(here, x, y) / floor));
    }
  if (darker_.empty()) return;
  const double mean =
      std::accumulate(darker_.begin(), darker_.end(), 0.0) / static_cast<double>(darker_.size());
  for (double& d : darker_) {
    d -= mean;
    square_ += d * d;
  }
}

bool FloorDarkening::meets(const Eigen::Vector3d& from_m, const Eigen::Vector3d& towards,
                           double inner_m, double outer_m) const {
  const double across = axis_.dot(towards);
  return std::any_of(middles_m_.begin(), middles_m_.end(), [&](const Eigen::Vector3d& middle_m) {
    const Eigen::Vector3d to_middle = middle_m - from_m;
    const double along = axis_.dot(to_middle) / across;
    if (!(along > 0.0)) return false;
    const double off2 = (along * towards - to_middle).squaredNorm();
    return off2 >= inner_m * inner_m && off2 <= outer_m * outer_m;
  });
}

bool FloorDarkening::Sums::tell() const {
  constexpr double kFewest = 4.0;
  return within >= kFewest && without >= kFewest;
}

FloorDarkening::Sums FloorDarkening::sums_under(const Eigen::Vector2d& lamp_aside) const {
  const Eigen::Vector3d towards(lamp_aside.x(), lamp_aside.y(), 1.0);
  Sums sums;
  for (std::size_t i = 0; i < at_m_.size(); ++i)
    if (meets(at_m_[i], towards, bore_m_, radius_m_)) sums.within += 1.0, sums.darker += darker_[i];
  sums.without = static_cast<double>(at_m_.size()) - sums.within;
  return sums;
}

FloorDarkening::Shadow FloorDarkening::shadow_of(const Eigen::Vector2d& lamp_aside) const {
  const Sums sums = sums_under(lamp_aside);
  if (!sums.tell() || sums.darker <= 0.0) return {};
  const double part = sums.darker / sums.square();
  return {part, part * sums.darker / square_};
}

double FloorDarkening::agrees(const Lamp& lamp) const {
  const Sums sums = sums_under(lamp.aside);
  if (!sums.tell()) return 0.0;
  const double expected = lamp.part * lamp.part * sums.square();
  return 2.0 * (2.0 * lamp.part * sums.darker - expected) / (square_ + expected);
}

}  // namespace trochoid::tracking
