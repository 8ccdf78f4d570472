#include "trochoid/data/white_jerk.hpp"

#include <gtest/gtest.h>

namespace trochoid::data {
namespace {

constexpr double kFirst_s = 0.3, kThen_s = 0.11, kRounding = 1e-14;

TEST(WhiteJerk, TwoStepsLeadWhereOneDoes) {
  const Eigen::Matrix3d two = white_jerk_transition(kThen_s) * white_jerk_transition(kFirst_s);
  EXPECT_TRUE(two.isApprox(white_jerk_transition(kFirst_s + kThen_s), kRounding));
}

TEST(WhiteJerk, TwoStepsAddTheUncertaintyOfOne) {
  const Eigen::Matrix3d move = white_jerk_transition(kThen_s);
  const Eigen::Matrix3d two =
      move * white_jerk_covariance(kFirst_s) * move.transpose() + white_jerk_covariance(kThen_s);
  EXPECT_TRUE(two.isApprox(white_jerk_covariance(kFirst_s + kThen_s), kRounding)) << two;
}

// An acceleration that walks at random is off by the square root of the time.
TEST(WhiteJerk, AccelerationSpreadsAsTimeGoesOn) {
  EXPECT_DOUBLE_EQ(white_jerk_covariance(2.0)(2, 2), 2.0);
  EXPECT_NEAR(white_jerk_covariance(2.0)(0, 0), 32.0 / 20.0, kRounding);
}

}  // namespace
}  // namespace trochoid::data
