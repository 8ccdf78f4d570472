#include "find/cast_shadow.hpp"

#include <gtest/gtest.h>

#include "drawn_shadow.hpp"
#include "edges/transfer_curve.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::tracking {
namespace {

constexpr double kLeaning = 0.6;
const Eigen::Vector2d kToTheSide(0.7, -0.4);

double explained(const cv::Mat& picture, const data::Pose<>& pose, const Eigen::Vector2d& aside,
                 const data::Body& body = drawn_body()) {
  return FloorDarkening(picture, drawn_floor(), body, pose, drawn_camera())
      .shadow_of(aside)
      .explained;
}

// Their outlines are the same, their shadows are not.
TEST(CastShadow, OfTwoAttitudesThatLookAlikeTheRightOneExplainsTheFloor) {
  for (const double phi : {0.0, 0.8, 2.0, 3.5, 5.0}) {
    const data::Pose<> right = standing(kLeaning, phi), mirrored = standing(kLeaning, phi + M_PI);
    const cv::Mat picture = drawn_with_shadow(right, kToTheSide);
    const double one = explained(picture, right, kToTheSide);
    EXPECT_GT(one, 0.9) << phi;
    EXPECT_LT(explained(picture, mirrored, kToTheSide), 0.7 * one) << phi;
  }
}

TEST(CastShadow, ALampElsewhereExplainsLess) {
  const data::Pose<> pose = standing(kLeaning, 0.8);
  const cv::Mat picture = drawn_with_shadow(pose, kToTheSide);
  const double right = explained(picture, pose, kToTheSide);
  for (const Eigen::Vector2d& off : {Eigen::Vector2d(-0.7, 0.4), Eigen::Vector2d(0.4, 0.7),
                                     Eigen::Vector2d(1.8, -1.0), Eigen::Vector2d(0.2, -0.1)})
    EXPECT_LT(explained(picture, pose, off), 0.8 * right) << off.transpose();
}

TEST(CastShadow, AFloorThatIsNowhereDarkerIsExplainedByNone) {
  const data::Pose<> pose = standing(kLeaning, 0.8);
  cv::Mat picture = drawn_floor();
  cv::fillPoly(picture, {outline_on_floor(pose, drawn_body().radius_m, {0.0, 0.0})}, kFace);
  EXPECT_EQ(explained(picture, pose, kToTheSide), 0.0);
}

// A reflection lies where a shadow would, but it is no shadow.
TEST(CastShadow, AFloorThatIsBrighterThereIsExplainedByNone) {
  const data::Pose<> pose = standing(kLeaning, 0.8);
  cv::Mat picture = drawn_with_shadow(pose, kToTheSide);
  picture.setTo(200.0, picture == kInShadow);
  EXPECT_EQ(explained(picture, pose, kToTheSide), 0.0);
}

TEST(CastShadow, LightFallsThroughTheBoreOfARing) {
  constexpr double kBore_m = 0.02;
  const data::Pose<> pose = standing(kLeaning, 0.8);
  const cv::Mat picture = drawn_with_shadow(pose, kToTheSide, kBore_m);
  data::Body ring = drawn_body();
  ring.inner_radius_m = kBore_m;
  EXPECT_GT(explained(picture, pose, kToTheSide, ring),
            1.2 * explained(picture, pose, kToTheSide, drawn_body()));
}

double drawn_part() {
  return 1.0 - light_of(kInShadow) / light_of(kFloor);
}

TEST(CastShadow, AsMuchOfTheLightIsMissingAsWasDrawn) {
  const data::Pose<> pose = standing(kLeaning, 0.8);
  const FloorDarkening floor(drawn_with_shadow(pose, kToTheSide), drawn_floor(), drawn_body(), pose,
                             drawn_camera());
  EXPECT_NEAR(floor.shadow_of(kToTheSide).part, drawn_part(), 0.05);
}

TEST(CastShadow, AShadowThatIsThereAgreesAndOneThatIsNotDoesNot) {
  const data::Pose<> pose = standing(kLeaning, 0.8);
  const Lamp lamp{kToTheSide, drawn_part()};
  const auto agrees = [&](const cv::Mat& picture) {
    return FloorDarkening(picture, drawn_floor(), drawn_body(), pose, drawn_camera()).agrees(lamp);
  };
  EXPECT_GT(agrees(drawn_with_shadow(pose, kToTheSide)), 0.9);
  EXPECT_LT(agrees(drawn_floor()), -1.9);
}

// What the body itself covers is no floor, at whatever tilt and however thick it is.
TEST(CastShadow, ADarkBodyIsNotTakenForAShadow) {
  for (const double theta : {0.3, 1.0, 1.3, 1.57})
    for (const double thickness_m : {0.002, 0.01, 0.02}) {
      data::Body body = drawn_body();
      body.thickness_m = thickness_m;
      const data::Pose<> pose = standing(theta, 0.8);
      const cv::Mat picture = drawn_cylinder(pose, thickness_m);
      const FloorDarkening floor(picture, drawn_floor(), body, pose, drawn_camera());
      for (const Eigen::Vector2d& aside : lamp_places())
        EXPECT_EQ(floor.shadow_of(aside).explained, 0.0) << theta << " " << thickness_m;
    }
}

TEST(CastShadow, AFloorThatIsEvenlyDarkerShowsNoShadow) {
  const data::Pose<> pose = standing(kLeaning, 0.8);
  cv::Mat picture = drawn_floor();
  picture -= 7.0;
  EXPECT_EQ(explained(picture, pose, kToTheSide), 0.0);
}

// A lens model that turns back on itself far from its middle has no rays there.
TEST(CastShadow, WhatNoRayLeadsToIsLeftOut) {
  data::Camera camera = data::Camera::overhead(240, 240, 1000.0, 0.5);
  camera.distortion[0] = -6.0;
  ASSERT_THROW((void)camera.ray_from_image({2.0, 2.0}), NumericalError);
  const data::Pose<> pose = standing(kLeaning, 0.8);
  data::Body large = drawn_body();
  large.radius_m = 0.05;
  EXPECT_NO_THROW(FloorDarkening(drawn_floor(), drawn_floor(), large, pose, camera));
}

TEST(CastShadow, LevelsOfALinearCameraAreLight) {
  const data::Pose<> pose = standing(kLeaning, 0.8);
  data::Camera camera = drawn_camera();
  camera.transfer = data::Transfer::linear;
  const FloorDarkening floor(drawn_with_shadow(pose, kToTheSide), drawn_floor(), drawn_body(), pose,
                             camera);
  EXPECT_NEAR(floor.shadow_of(kToTheSide).part, 1.0 - kInShadow / kFloor, 0.03);
}

// Lying flat, it hides its own.
TEST(CastShadow, AShadowThatIsHiddenTellsNothing) {
  data::Pose<> pose = standing(0.0, 0.0);
  pose.centre_m.z() = 0.001;
  const FloorDarkening floor(drawn_floor(), drawn_floor(), drawn_body(), pose, drawn_camera());
  EXPECT_EQ(floor.agrees({kToTheSide, drawn_part()}), 0.0);
}

TEST(CastShadow, ABodyOutOfThePictureShowsNothing) {
  data::Pose<> pose = standing(kLeaning, 0.8);
  pose.centre_m.x() = 1.0;
  EXPECT_EQ(explained(drawn_floor(), pose, kToTheSide), 0.0);
}

}  // namespace
}  // namespace trochoid::tracking
