#pragma once
#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "find/cast_shadow.hpp"
#include "trochoid/data/pose_motion.hpp"

namespace trochoid::tracking {

/// A disc, 60 px across, and a camera straight above it.
inline data::Body drawn_body() {
  data::Body body;
  body.radius_m = 0.03;
  body.thickness_m = 0.002;
  return body;
}

inline data::Camera drawn_camera() {
  return data::Camera::from_scale(240, 240, 1000.0);
}

/// Standing on its rim in the middle of the picture.
inline data::Pose<> standing(double theta_rad, double phi_rad) {
  data::Pose<> pose;
  pose.theta_rad = theta_rad;
  pose.phi_rad = phi_rad;
  pose.centre_m = {0.0, 0.0, drawn_body().radius_m * std::sin(theta_rad)};
  return pose;
}

/// The mean outline of a round plate of this radius, its points let down to the floor along `fall`,
/// the horizontal way per height.
inline std::vector<cv::Point> outline_on_floor(const data::Pose<>& pose, double radius_m,
                                               const Eigen::Vector2d& fall) {
  const Eigen::Vector3d axis = axis_of(pose);
  const Eigen::Vector3d level(std::cos(pose.phi_rad), std::sin(pose.phi_rad), 0.0);
  const Eigen::Vector3d steep = axis.cross(level);
  std::vector<cv::Point> points;
  for (int i = 0; i < 180; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / 180;
    const Eigen::Vector3d at =
        pose.centre_m + radius_m * (std::cos(angle) * level + std::sin(angle) * steep);
    const Eigen::Vector3d down(at.x() + at.z() * fall.x(), at.y() + at.z() * fall.y(), 0.0);
    const Eigen::Vector2d px = drawn_camera().image_from_table<double>(down);
    points.emplace_back(static_cast<int>(std::lround(px.x())),
                        static_cast<int>(std::lround(px.y())));
  }
  return points;
}

inline constexpr double kFloor = 150.0, kInShadow = 100.0, kFace = 60.0;

/// A plain floor with the plate on it and the shadow it throws under a lamp.
inline cv::Mat drawn_with_shadow(const data::Pose<>& pose, const Eigen::Vector2d& lamp_aside,
                                 double bore_m = 0.0) {
  const cv::Size size(240, 240);
  cv::Mat shadow = cv::Mat::zeros(size, CV_8U);
  cv::fillPoly(shadow, {outline_on_floor(pose, drawn_body().radius_m, -lamp_aside)}, 255);
  if (bore_m > 0.0) cv::fillPoly(shadow, {outline_on_floor(pose, bore_m, -lamp_aside)}, 0);
  cv::Mat picture(size, CV_8U, cv::Scalar(kFloor));
  picture.setTo(kInShadow, shadow);
  cv::fillPoly(picture, {outline_on_floor(pose, drawn_body().radius_m, {0.0, 0.0})}, kFace);
  if (bore_m > 0.0) cv::fillPoly(picture, {outline_on_floor(pose, bore_m, {0.0, 0.0})}, kFloor);
  return picture;
}

inline cv::Mat drawn_floor() {
  return {cv::Size(240, 240), CV_8U, cv::Scalar(kFloor)};
}

/// A plain floor with a body of that thickness on it, seen from straight above, that throws no
/// shadow.
inline cv::Mat drawn_cylinder(const data::Pose<>& pose, double thickness_m) {
  std::vector<cv::Point> rims, hull;
  for (const double off_m : {-0.5 * thickness_m, 0.5 * thickness_m}) {
    data::Pose<> face = pose;
    face.centre_m += off_m * axis_of(pose);
    for (const cv::Point& p : outline_on_floor(face, drawn_body().radius_m, {0.0, 0.0}))
      rims.push_back(p);
  }
  cv::convexHull(rims, hull);
  cv::Mat picture = drawn_floor();
  cv::fillConvexPoly(picture, hull, kFace);
  return picture;
}

}  // namespace trochoid::tracking
