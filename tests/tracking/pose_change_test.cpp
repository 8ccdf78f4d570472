#include "geometry/pose_change.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "trochoid/data/pose_motion.hpp"

namespace trochoid::tracking {
namespace {

using Centre = PoseChange::Centre;
constexpr double kRounding = 1e-12;

/// A disc that rolls round a circle at a steady tilt, `turn_rad` on.
data::Pose<> rolling_round(double theta_rad, double turn_rad) {
  constexpr double kCircle_m = 0.05, kHeight_m = 0.02;
  data::Pose<> pose;
  pose.theta_rad = theta_rad, pose.phi_rad = turn_rad;
  pose.centre_m = {kCircle_m * std::cos(turn_rad), kCircle_m * std::sin(turn_rad), kHeight_m};
  return pose;
}

void expect_same(const data::Pose<>& a, const data::Pose<>& b, double tolerance) {
  EXPECT_NEAR((axis_of(a) - axis_of(b)).norm(), 0.0, tolerance);
  EXPECT_NEAR((a.centre_m - b.centre_m).norm(), 0.0, tolerance);
}

TEST(PoseChange, LeadsBackToWhereItCameFrom) {
  for (const double theta : {0.0, 0.1, 0.7, 1.5})
    for (const auto centre : {Centre::straight, Centre::turning}) {
      const auto from = rolling_round(theta, 3.0), to = rolling_round(theta + 0.05, 3.4);
      const auto back = PoseChange(from, to).on(to, -1.0, centre);
      // Between two axes near the vertical goes a chord, and its ends are brought to length one.
      expect_same(back, from, is_steep(from) ? 1e-4 : kRounding);
    }
}

TEST(PoseChange, SteadyRollingGoesOnInItsCircle) {
  const auto from = rolling_round(0.7, 0.0), to = rolling_round(0.7, 0.5);
  expect_same(PoseChange(from, to).on(to, 1.0, Centre::turning), rolling_round(0.7, 1.0),
              kRounding);
}

TEST(PoseChange, AnAxisThatPassesTheVerticalGoesOnBeyondIt) {
  data::Pose<> from, to;
  from.theta_rad = 0.1, to.theta_rad = 0.02;
  const Eigen::Vector3d axis = axis_of(PoseChange(from, to).on(to, 1.0));
  // It went 0.08 towards +y and goes 0.06 beyond the vertical; chord for arc costs the third power.
  EXPECT_NEAR(axis.y(), 0.06, 1e-3);
  EXPECT_NEAR(axis.x(), 0.0, kRounding);
}

TEST(PoseChange, OverTwoStepsTheMeanGoesOnThoughTogetherTheyAreMoreThanHalfATurn) {
  const auto before = rolling_round(0.7, 0.0), now = rolling_round(0.7, 1.9),
             after = rolling_round(0.7, 3.6);
  EXPECT_NEAR(PoseChange(before, now, after, PoseChange::kBeside).on(now, 1.0).phi_rad, 1.9 + 1.8,
              kRounding);
}

TEST(PoseChange, TheFaceNearerToAnotherPoseIsTheSameBodyTurnedOver) {
  const auto pose = rolling_round(0.7, 0.3);
  const auto over = nearer_face(data::turned_over(pose, 0.0), pose, 0.0);
  expect_same(over, pose, kRounding);
}

}  // namespace
}  // namespace trochoid::tracking
