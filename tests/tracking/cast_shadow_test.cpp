#include "cast_shadow.hpp"

#include <gtest/gtest.h>

#include "drawn_shadow.hpp"

namespace trochoid::tracking {
namespace {

constexpr double kTilt = 0.6;
const Lamp kLamp(0.7, -0.4);

double explained(const cv::Mat& picture, const data::Pose<>& pose, const Lamp& lamp,
                 data::Body body = drawn_body()) {
  return FloorDarkening(picture, drawn_floor(), body, pose, drawn_camera()).explained(lamp);
}

// Their outlines are the same, their shadows are not.
TEST(CastShadow, OfTwoAttitudesThatLookAlikeTheRightOneExplainsTheFloor) {
  for (const double phi : {0.0, 0.8, 2.0, 3.5, 5.0}) {
    const data::Pose<> right = standing(kTilt, phi), mirrored = standing(kTilt, phi + M_PI);
    const cv::Mat picture = drawn_with_shadow(right, kLamp);
    const double one = explained(picture, right, kLamp);
    EXPECT_GT(one, 0.9) << phi;
    EXPECT_LT(explained(picture, mirrored, kLamp), 0.7 * one) << phi;
  }
}

TEST(CastShadow, ALampElsewhereExplainsLess) {
  const data::Pose<> pose = standing(kTilt, 0.8);
  const cv::Mat picture = drawn_with_shadow(pose, kLamp);
  const double right = explained(picture, pose, kLamp);
  for (const Lamp& off : {Lamp(-0.7, 0.4), Lamp(0.4, 0.7), Lamp(1.8, -1.0), Lamp(0.2, -0.1)})
    EXPECT_LT(explained(picture, pose, off), 0.8 * right) << off.transpose();
}

TEST(CastShadow, AFloorThatIsNowhereDarkerIsExplainedByNone) {
  const data::Pose<> pose = standing(kTilt, 0.8);
  cv::Mat picture = drawn_floor();
  cv::fillPoly(picture, {outline_on_floor(pose, drawn_body().radius_m, {0.0, 0.0})}, kFace);
  EXPECT_EQ(explained(picture, pose, kLamp), 0.0);
}

// A reflection lies where a shadow would, but it is no shadow.
TEST(CastShadow, AFloorThatIsBrighterThereIsExplainedByNone) {
  const data::Pose<> pose = standing(kTilt, 0.8);
  cv::Mat picture = drawn_with_shadow(pose, kLamp);
  picture.setTo(200.0, picture == kInShadow);
  EXPECT_EQ(explained(picture, pose, kLamp), 0.0);
}

TEST(CastShadow, LightFallsThroughTheBoreOfARing) {
  constexpr double kBore_m = 0.02;
  const data::Pose<> pose = standing(kTilt, 0.8);
  const cv::Mat picture = drawn_with_shadow(pose, kLamp, kBore_m);
  data::Body ring = drawn_body();
  ring.inner_radius_m = kBore_m;
  EXPECT_GT(explained(picture, pose, kLamp, ring),
            1.2 * explained(picture, pose, kLamp, drawn_body()));
}

TEST(CastShadow, ABodyOutOfThePictureShowsNothing) {
  data::Pose<> pose = standing(kTilt, 0.8);
  pose.centre_m.x() = 1.0;
  EXPECT_EQ(explained(drawn_floor(), pose, kLamp), 0.0);
}

}  // namespace
}  // namespace trochoid::tracking
