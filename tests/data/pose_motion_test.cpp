#include "trochoid/data/pose_motion.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace trochoid::data {
namespace {

Body leaning_disc() {
  Body body;
  body.kind = BodyKind::disc;
  body.radius_m = 0.03;
  body.thickness_m = 0.01;
  return body;
}

Camera looking_down() {
  return Camera::overhead(640, 480, 2000.0, 0.5);
}

// A support, and a pose that it allows.
struct Held {
  Support support;
  Pose<> pose;
};

std::vector<Held> each_support() {
  const Eigen::Vector3d pivot_m(0.01, -0.02, 0.005);
  const Pose<> leaning{{0.04, 0.01, height_on_floor_m(0.7, 0.03, 0.005)}, 0.7, -2.0, 0.4};
  const Pose<> flat{{0.04, 0.01, 0.005}, 0.0, 0.3, 0.4};
  Pose<> on_pivot{{}, 0.7, 1.0, 0.4};
  on_pivot.centre_m = pivot_m + 0.04 * symmetry_axis(on_pivot.theta_rad, on_pivot.phi_rad);
  return {{{SupportKind::floor, {}}, leaning},
          {{SupportKind::flat, {}}, flat},
          {{SupportKind::pivot, pivot_m}, on_pivot},
          {{SupportKind::none, {}}, leaning}};
}

TEST(PoseMotion, MovesABodyAtTheVelocitiesItTells) {
  constexpr double kStep = 1e-6, kSecondOrder = 1e-10;
  for (const auto& [support, pose] : each_support()) {
    const PoseMotion motion(leaning_disc(), support, looking_down());
    const auto velocities = motion.velocities(pose);
    ASSERT_EQ(velocities.cols(), motion.count());
    for (int k = 0; k < motion.count(); ++k) {
      const Pose<> there = motion.moved(pose, kStep * PoseMotion::Step::Unit(motion.count(), k));
      const Eigen::Vector3d velocity = velocities.col(k).head<3>();
      const Eigen::Vector3d turning = velocities.col(k).tail<3>();
      EXPECT_LT((there.centre_m - pose.centre_m - kStep * velocity).norm(), kSecondOrder) << k;
      EXPECT_LT((axis_of(there) - axis_of(pose) - kStep * turning.cross(axis_of(pose))).norm(),
                kSecondOrder)
          << k;
    }
  }
}

TEST(PoseMotion, LeavesABodyOnItsSupport) {
  constexpr double kRounding = 1e-15;
  for (const auto& [support, pose] : each_support()) {
    const PoseMotion motion(leaning_disc(), support, looking_down());
    const Pose<> there = motion.moved(pose, PoseMotion::Step::Constant(motion.count(), 0.02));
    const Pose<> settled = motion.settled(there);
    EXPECT_LT((settled.centre_m - there.centre_m).norm(), kRounding);
    EXPECT_LT((axis_of(settled) - axis_of(there)).norm(), kRounding);
    if (support.kind == SupportKind::floor)
      EXPECT_NEAR(there.centre_m.z(), height_on_floor_m(there.theta_rad, 0.03, 0.005), kRounding);
  }
}

TEST(PoseMotion, FindsTheStepBetweenTwoPoses) {
  constexpr double kSecondOrder = 1e-6;
  for (const auto& [support, pose] : each_support()) {
    const PoseMotion motion(leaning_disc(), support, looking_down());
    const PoseMotion::Step step = PoseMotion::Step::LinSpaced(motion.count(), -3e-4, 5e-4);
    const PoseMotion::Step found = motion.step_between(pose, motion.moved(pose, step));
    EXPECT_LT((found - step).cwiseAbs().maxCoeff(), kSecondOrder);
  }
}

}  // namespace
}  // namespace trochoid::data
