#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "drawn_clip.hpp"
#include "trochoid/data/pose_motion.hpp"
#include "trochoid/tracking/tracker.hpp"

// Recordings whose rows are read one after the other.
namespace trochoid::tracking {
namespace {

constexpr double kPicturesPerS = 100.0, kReadInTurn_s = 0.009, kDisc_m = 0.02;
constexpr int kRowLength_px = 320, kRowsInTurn = 140, kPicturesInTurn = 36;

/// A thin disc that goes its way over the floor while its tilt turns about the vertical.
data::Pose<> in_motion(double t_s) {
  data::Pose<> pose;
  pose.theta_rad = 0.8;
  pose.phi_rad = 0.3 + 9.0 * t_s;
  pose.centre_m = {-0.045 + 0.25 * t_s, 0.003 - 0.02 * t_s, kDisc_m * std::sin(pose.theta_rad)};
  return pose;
}

/// Distance from the middle of the disc, over its radius, where a pixel's ray meets its plane.
double out_from_middle(const data::Camera& camera, const data::Pose<>& pose,
                       const Eigen::Vector2d& pixel) {
  const Eigen::Vector3d floor = camera.table_from_image(pixel, 0.0),
                        above = camera.table_from_image(pixel, kDisc_m), axis = data::axis_of(pose);
  const double share = axis.dot(pose.centre_m - floor) / axis.dot(above - floor);
  return (floor + share * (above - floor) - pose.centre_m).norm() / kDisc_m;
}

/// Each row as the disc is when that is read; the rim is blurred by 0.7 px.
void draw_read_in_turn(const data::Camera& camera, cv::Mat& picture, int frame) {
  constexpr double kLevel = 50.0, kBlur_px = 0.7, kStep_px = 0.01;
  for (int y = 0; y < picture.rows; ++y) {
    const data::Pose<> pose =
        in_motion(frame / kPicturesPerS + kReadInTurn_s * y / (picture.rows - 1.0));
    for (int x = 0; x < picture.cols; ++x) {
      const auto out_at = [&](double dx, double dy) {
        return out_from_middle(camera, pose, {x + dx, y + dy});
      };
      const double out = out_at(0.0, 0.0);
      if (out > 1.3) continue;
      const double slope =
          std::hypot(out_at(kStep_px, 0.0) - out, out_at(0.0, kStep_px) - out) / kStep_px;
      const double outside_px = (out - 1.0) / std::max(slope, 1e-6);
      const double cover = 0.5 * std::erfc(outside_px / (kBlur_px * std::numbers::sqrt2));
      picture.at<double>(y, x) += cover * (kLevel - picture.at<double>(y, x));
    }
  }
}

struct OffInTurn {
  double centre_m = 0.0, tilt_rad = 0.0, precession_rad = 0.0;  // rms
};

OffInTurn off_of(const data::Track& track) {
  OffInTurn sum;
  int told = 0;
  for (const data::TrackSample& sample : track.samples) {
    if (!sample.phi) continue;
    ++told;
    const data::Pose<> pose = in_motion(sample.t_s);
    sum.centre_m += (sample.centre_m - pose.centre_m.head<2>()).squaredNorm();
    sum.tilt_rad += std::pow(sample.theta->value_rad - pose.theta_rad, 2);
    sum.precession_rad += std::pow(sample.phi->value_rad - pose.phi_rad, 2);
  }
  EXPECT_GT(told, 0.9 * kPicturesInTurn);
  return {std::sqrt(sum.centre_m / told), std::sqrt(sum.tilt_rad / told),
          std::sqrt(sum.precession_rad / told)};
}

TEST(RollingShutter, LeavesCentreTiltAndPrecessionThoseOfTheMomentATrackTells) {
  const ScratchFolder folder("rolling");
  data::Camera camera = data::Camera::overhead(kRowLength_px, kRowsInTurn, 2000.0, 0.2);
  write_clip(folder / "clip.mkv", drawn_floor(kRowLength_px, kRowsInTurn, 190.0), kPicturesInTurn,
             1.0, [&](cv::Mat& picture, int i) { draw_read_in_turn(camera, picture, i); });
  data::Scene scene;
  scene.body.emplace();
  scene.body->radius_m = kDisc_m;
  scene.body->thickness_m = 1e-5;
  const auto off = [&] {
    return off_of(track_video(folder / "clip.mkv", scene, camera).file.tracks.at(0));
  };
  const OffInTurn at_once = off();
  camera.readout_s = kReadInTurn_s;  // the scene says nothing
  const OffInTurn in_turn = off();
  EXPECT_LT(in_turn.centre_m, 3e-5);
  EXPECT_LT(in_turn.tilt_rad, 0.002);
  EXPECT_LT(in_turn.precession_rad, 0.003);
  EXPECT_GT(at_once.tilt_rad, 0.02);
  EXPECT_GT(at_once.precession_rad, 0.04);
}

}  // namespace
}  // namespace trochoid::tracking
