#include "trochoid/data/pose.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

namespace trochoid::data {
namespace {

Eigen::Matrix3d attitude(const Pose<>& pose) {
  using Turn = Eigen::AngleAxisd;
  return (Turn(pose.phi_rad, Eigen::Vector3d::UnitZ()) *
          Turn(pose.theta_rad, Eigen::Vector3d::UnitX()) *
          Turn(pose.psi_rad, Eigen::Vector3d::UnitZ()))
      .toRotationMatrix();
}

TEST(TurnedOver, ABodyShowsItsOtherFaceAndItsMarkWhereItWas) {
  constexpr double kMark_rad = 0.7, kRounding = 1e-14;
  const Pose<> pose{{0.1, 0.2, 0.03}, 0.4, 1.1, -2.3};
  const Pose<> over = turned_over(pose, kMark_rad);
  const Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d mark(std::cos(kMark_rad), std::sin(kMark_rad), 0.0);
  EXPECT_LT((attitude(over) * axis + attitude(pose) * axis).norm(), kRounding);
  EXPECT_LT((attitude(over) * mark - attitude(pose) * mark).norm(), kRounding);
  EXPECT_EQ(over.centre_m, pose.centre_m);
  EXPECT_LT((attitude(turned_over(over, kMark_rad)) - attitude(pose)).norm(), kRounding);
}

}  // namespace
}  // namespace trochoid::data
