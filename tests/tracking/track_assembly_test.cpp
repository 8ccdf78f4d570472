#include "link/track_assembly.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <complex>
#include <functional>
#include <limits>
#include <memory>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <random>

// What the frames of a body become as a track.
namespace trochoid::tracking {
namespace {

constexpr double kPi = std::numbers::pi;

/// A body that turns by 0.5 rad a frame about an axis of which the picture does not tell how it
/// leans.
BodyPath turning(double first_phi_rad, double first_psi_rad) {
  BodyPath path;
  for (int i = 0; i < 30; ++i) {
    PoseMeasurement pose;
    pose.pose.centre_m.setZero();
    pose.pose.theta_rad = 0.01;
    pose.pose.phi_rad = first_phi_rad;
    pose.pose.psi_rad = std::remainder(first_psi_rad + 0.5 * i, 2.0 * kPi);
    pose.covariance_m2 = Eigen::Matrix2d::Identity();
    pose.centre_px.setZero();
    pose.covariance_px2 = Eigen::Matrix2d::Identity();
    pose.sigma_phi_rad = 0.5;
    pose.sigma_psi_rad = 0.5;
    BodyPath::At& at = path.frames[i];
    at.t_s = 0.01 * i;
    at.seen.pose = pose;
  }
  return path;
}

TEST(TrackAssembly, CountsAnglesFromWithinHalfATurnOfZero) {
  for (const double phi_rad : {-3.0, 0.0, 3.0}) {
    for (const bool on_pin : {false, true}) {
      const BodyPath path = turning(phi_rad, 2.5);
      const data::Track track = assemble_track(path, 0, {}, {.on_pin = on_pin});
      ASSERT_TRUE(track.samples.front().psi && track.samples.back().psi);
      const double first = track.samples.front().psi->value_rad;
      EXPECT_LE(std::abs(first), kPi);
      EXPECT_NEAR(std::remainder(first - (on_pin ? phi_rad : 0.0) - 2.5, 2.0 * kPi), 0.0, 1e-12);
      EXPECT_NEAR(track.samples.back().psi->value_rad - first, 0.5 * 29, 1e-9);
    }
  }
}

TEST(TrackAssembly, TellsNoSpinWhereTheNodeLineItIsCountedFromIsNotKnown) {
  BodyPath path = turning(1.0, 2.0);
  path.frames[7].seen.pose->sigma_phi_rad = std::numeric_limits<double>::infinity();
  const data::Track rolls = assemble_track(path, 0, {}, {});
  EXPECT_TRUE(rolls.samples[6].psi && rolls.samples[8].psi);
  EXPECT_FALSE(rolls.samples[7].phi || rolls.samples[7].psi);
  // Seen face on, it is the turn about the vertical that is told.
  EXPECT_TRUE(assemble_track(path, 0, {}, {.on_pin = true}).samples[7].psi);
  // Of one that always lies on its face it does not move.
  EXPECT_TRUE(assemble_track(path, 0, {}, {.flat = true}).samples[7].psi);
}

// Frames that scatter twice as far as they claim and may all be off by ten times that.
TEST(TrackAssembly, WhatAllFramesMayBeOffByDoesNotHideHowFarTheyScatter) {
  constexpr double kClaimed_m = 1e-4, kOff_m = 1e-3;
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  BodyPath path = turning(0.0, 0.0);
  for (int i = 0; i < 200; ++i) {
    path.frames[i] = path.frames[0];
    BodyPath::At& at = path.frames[i];
    at.t_s = 0.01 * i;
    at.seen.pose->pose.centre_m.head<2>() =
        2.0 * kClaimed_m * Eigen::Vector2d{normal(random), normal(random)};
    at.seen.pose->covariance_m2 = kClaimed_m * kClaimed_m * Eigen::Matrix2d::Identity();
    at.seen.other_readings[0].m2 = kOff_m * kOff_m * Eigen::Matrix2d::Identity();
  }
  // It scores as high as the chosen one.
  path.readings[0] = {.looked_at = 17.0, .found = 17.0, .log_score_ratio = 0.0, .square = 17.0};
  double mean_m2 = 0.0;
  for (const auto& sample : assemble_track(path, 0, {}, {}).samples)
    mean_m2 += sample.covariance_m2(0, 0) / 200.0;
  // The scatter of the stretches it is taken from.
  constexpr double kTolerance = 0.3;
  EXPECT_NEAR((mean_m2 - 0.5 * kOff_m * kOff_m) / (kClaimed_m * kClaimed_m), 4.0, kTolerance * 4.0);
}

// Followed by its rim alone, with a mark that was seen to turn.
BodyPath marked(const std::function<double(int)>& direction_rad) {
  cv::Mat face(64, 64, CV_8U, cv::Scalar(90));
  cv::circle(face, {42, 32}, 4, cv::Scalar(250), cv::FILLED);
  const auto profile =
      SpinProfile::from_face(face, Ellipse::from_axes({32.0, 32.0}, 20.0, 20.0, 0.0), 1.0);
  BodyPath path;
  path.marks = std::make_shared<const SpinProfile>(profile.value());
  for (int i = 0; i < 20; ++i) {
    BodyPath::At& at = path.frames[i];
    at.t_s = 0.01 * i;
    at.seen.rim = Ellipse::from_axes({32.0, 32.0}, 20.0, 10.0, direction_rad(i));
    at.seen.covariance_px2 = Eigen::Matrix2d::Identity();
    at.seen.turned_rad = 0.1 * i;
  }
  return path;
}

// Seen from the side a body that lies is as narrow as one that tilts; the narrow side of that goes
// round.
TEST(TrackAssembly, OnlyOfABodyThatLiesDoesItsFaceTellTheSpin) {
  const auto spins = [](const BodyPath& path) {
    return assemble_track(path, 0, {}, {}).samples.back().psi.has_value();
  };
  EXPECT_TRUE(spins(marked([](int) { return 0.4; })));
  EXPECT_TRUE(spins(marked([](int i) { return 0.4 + 0.01 * i; }))) << "on its way past the camera";
  EXPECT_FALSE(spins(marked([](int i) { return 0.1 * i; })));
}

// What is thrown up before a camera that looks along the floor passes the horizon.
TEST(TrackAssembly, MetresStayUnknownWhereNoFloorIsSeen) {
  constexpr int kWidth = 200, kHeight = 100;
  data::Camera floor = data::Camera::overhead(kWidth, kHeight, 100.0, 1.0);
  floor.camera_from_table << 1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0;
  floor.camera_from_table_m = {0.0, 1.0, 0.0};
  BodyPath path;
  for (const double y_px : {20.0, 80.0}) {
    BodyPath::At& at = path.frames[static_cast<std::int64_t>(y_px)];
    at.t_s = 0.01 * y_px;
    at.seen.centre_px = {0.5 * kWidth, y_px};
    at.seen.covariance_px2 = Eigen::Matrix2d::Identity();
  }
  const data::Track track = assemble_track(path, 0, floor, {});
  ASSERT_EQ(track.samples.size(), 2u);
  EXPECT_FALSE(track.samples[0].has_metres() || track.samples[0].has_covariance());
  EXPECT_TRUE(track.samples[1].has_metres() && track.samples[1].has_covariance());
  EXPECT_NO_THROW(data::check(track, "track"));
}

// A top seen by a camera that sinks by a pixel: metres and the direction of its axis are those that
// the camera would have shown before, and the spin that is counted from it takes the turn back.
TEST(TrackAssembly, OfACameraThatMovesIsWhatOneThatStandsStillWouldShow) {
  const data::Camera camera = data::Camera::overhead(640, 480, 1000.0, 1.2);
  const Eigen::Vector2d pivot_m(0.01, -0.02);
  PoseMeasurement pose;
  pose.pose.theta_rad = 0.5;
  pose.pose.psi_rad = 0.3;
  pose.centre_px.setZero();
  pose.covariance_m2 = pose.covariance_px2 = 1e-8 * Eigen::Matrix2d::Identity();
  pose.sigma_theta_rad = pose.sigma_phi_rad = 0.001;
  pose.sigma_psi_rad = 0.001;
  BodyPath path;
  AssemblyOptions how;
  how.camera = &camera;
  how.pivot_m = pivot_m;
  constexpr double kLength_m = 0.03, kPhi_rad = 0.4;
  // The axis points from the pivot to the centre: along (sin phi, -cos phi).
  const Eigen::Vector2d before_m =
      pivot_m + kLength_m * Eigen::Vector2d(std::sin(kPhi_rad), -std::cos(kPhi_rad));
  const Eigen::Vector3d there_m(before_m.x(), before_m.y(), 0.0);
  for (int i = 0; i < 30; ++i) {
    const Eigen::Vector2d gone_px(0.1 * i, -0.05 * i);
    const Eigen::Vector2d seen_m =
        before_m + camera.jacobian_px_per_m(there_m).leftCols<2>().inverse() * gone_px;
    const Eigen::Vector2d from_m = seen_m - pivot_m;
    pose.pose.centre_m = {seen_m.x(), seen_m.y(), 0.0};
    pose.pose.phi_rad = std::atan2(from_m.x(), -from_m.y());
    path.frames[i].t_s = 0.01 * i;
    path.frames[i].seen.pose = pose;
    if (i != 11) how.shifts[i] = {gone_px, 0.01};
  }
  const data::Track track = assemble_track(path, 0, {}, how);
  for (std::size_t i = 0; i < track.samples.size(); ++i) {
    const data::TrackSample& sample = track.samples[i];
    // A frame in which the floor was hidden has its neighbour's shift, a tenth of a pixel from its
    // own.
    const bool hidden = i == 11;
    EXPECT_LT((sample.centre_m - before_m).norm(), hidden ? 2e-4 : 1e-6);
    EXPECT_NEAR(sample.phi->value_rad, kPhi_rad, hidden ? 5e-3 : 1e-4);
    if (hidden) continue;
    const double turned_rad = kPhi_rad - path.frames[static_cast<int>(i)].seen.pose->pose.phi_rad;
    EXPECT_NEAR(sample.psi->value_rad, 0.3 - std::cos(0.5) * turned_rad, 1e-4);
    EXPECT_GT(sample.covariance_m2(0, 0), 1e-8);
  }
}

/// What samples say of a turn about the vertical.
using Turns = std::function<double(const data::TrackSample&)>;

// By the same angle to either side: seen of precession, of the spin of a body that lies, of a body
// seen face on, and of a rim that is followed with its mark.
TEST(TrackAssembly, ACameraThatTurnsToEitherSideIsTakenBack) {
  constexpr double kTurned_rad = 0.02;
  constexpr int kFrom = 10;
  const data::Camera camera = data::Camera::overhead(640, 480, 1000.0, 1.2);
  const auto of_psi = [](const data::TrackSample& s) { return s.psi->value_rad; };
  const auto of_phi = [](const data::TrackSample& s) { return s.phi->value_rad; };
  for (const double turned_rad : {kTurned_rad, -kTurned_rad}) {
    AssemblyOptions how;
    how.camera = &camera;
    for (int i = 0; i < 30; ++i)
      how.shifts[i].factor = std::polar(1.0, i < kFrom ? 0.0 : turned_rad);
    const auto expect_steady = [&](const BodyPath& path, const Turns& turn, double each_rad) {
      const data::Track track = assemble_track(path, 0, {}, how);
      for (std::size_t i = 0; i < track.samples.size(); ++i)
        EXPECT_NEAR(turn(track.samples[i]) - turn(track.samples[0]),
                    each_rad * static_cast<double>(i), 1e-9)
            << "turned by " << turned_rad << ", frame " << i;
    };
    // Turning right on the screen is a negative turn in the table frame.
    BodyPath tilted = turning(1.0, 0.0), lies = turning(0.0, 0.0),
             rim = marked([](int) { return 0.4; });
    for (int i = kFrom; i < 30; ++i) {
      tilted.frames[i].seen.pose->pose.phi_rad -= turned_rad;
      lies.frames[i].seen.pose->pose.psi_rad -= turned_rad;
    }
    for (int i = kFrom; i < 20; ++i) *rim.frames[i].seen.turned_rad += turned_rad;
    expect_steady(tilted, of_phi, 0.0);
    how.on_pin = true;
    expect_steady(tilted, of_psi, 0.5);
    how.on_pin = false;
    how.flat = true;
    expect_steady(lies, of_psi, 0.5);
    how.flat = false;
    expect_steady(rim, of_psi, -0.1);
  }
}

// Where the node line may be off, spin, which is counted from it, is off by as much.
TEST(TrackAssembly, ACameraThatLeansMakesSpinUncertainWithThePrecession) {
  const data::Camera camera = data::Camera::overhead(640, 480, 1000.0, 1.2);
  BodyPath path = turning(1.0, 0.0);
  for (auto& [index, at] : path.frames) {
    at.seen.pose->pose.theta_rad = 0.5;
    at.seen.pose->sigma_phi_rad = *(at.seen.pose->sigma_psi_rad = 1e-4);
  }
  AssemblyOptions how;
  how.camera = &camera;
  for (int i = 0; i < 30; ++i) how.shifts[i].px = {i < 10 ? 0.0 : 30.0, 0.0};
  const data::TrackSample last = assemble_track(path, 0, {}, how).samples.back();
  EXPECT_GT(last.phi->sigma_rad, 0.01);
  EXPECT_NEAR(last.psi->sigma_rad, std::cos(0.5) * last.phi->sigma_rad, 1e-3);
}

}  // namespace
}  // namespace trochoid::tracking
