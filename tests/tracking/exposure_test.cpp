#include "geometry/exposure.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "drawn_clip.hpp"
#include "edges/colour_window.hpp"
#include "trochoid/tracking/outline_fit.hpp"

namespace trochoid::tracking {
namespace {

data::Body flat_disc() {
  data::Body body;
  body.radius_m = 0.03, body.thickness_m = 0.002;
  return body;
}

// A disc lying flat that slides by 12 px during the exposure: along the normal of each point its
// rim moves by the part of the way that points there, and at the ends of the exposure is half of
// that away.
TEST(Exposure, ASlidingDiscSweepsByItsWayAlongTheNormal) {
  const data::Body body = flat_disc();
  const auto camera = data::Camera::from_scale(200, 200, 1000.0);
  const data::PoseMotion motion(body, {data::SupportKind::flat, {}}, camera);
  data::Pose<> middle, before;
  middle.centre_m = camera.table_from_image({100.0, 100.0}, 0.001);
  before.centre_m = middle.centre_m - Eigen::Vector3d(0.024, 0.0, 0.0);
  const ExposureMotion exposure(before, middle, 0.5);
  const auto outline = outline_samples(body, middle, camera, motion, 2.0);
  constexpr int kParts = 6;
  const auto sweeps =
      sweeps_of(moments_of(body, camera, motion, exposure, middle, kParts), outline);
  int known = 0;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    if (sweeps[i].count == 0) continue;
    ++known;
    const double slid_px = 12.0 * outline[i].normal_px.x();
    EXPECT_NEAR(sweeps[i].half_range_px(), 0.5 * std::abs(slid_px), 0.6);
    // A circle of 30 px moved by s aside bends away by s^2 / 60: 0.6 px at the ends.
    EXPECT_NEAR(sweeps[i].shift_px[0], -slid_px * 0.5 * (kParts - 1) / kParts, 0.6);
  }
  EXPECT_GT(known, static_cast<int>(outline.size()) / 2);
}

// Half an exposure forwards and back again; what turns keeps its tilt.
TEST(Exposure, PrecessionGoesOnThroughTheMiddle) {
  data::Pose<> before, middle;
  before.theta_rad = middle.theta_rad = 0.8;
  before.phi_rad = 1.0, middle.phi_rad = 1.6;
  const ExposureMotion exposure(before, middle, 0.5);
  EXPECT_NEAR(exposure.at(middle, 0.5).phi_rad, 1.6 + 0.15, 1e-12);
  EXPECT_NEAR(exposure.at(middle, -0.5).phi_rad, 1.6 - 0.15, 1e-12);
  EXPECT_NEAR(exposure.at(middle, 0.5).theta_rad, 0.8, 1e-12);
}

// A disc that slides by 10 px while the shutter is open, drawn as the mean of many positions.
TEST(Exposure, ASmearedDiscIsMeasuredInTheMiddleOfItsWay) {
  constexpr double kSlid_px = 10.0;
  constexpr int kMoments = 40;
  const data::Body body = flat_disc();
  const auto camera = data::Camera::from_scale(200, 160, 1000.0);
  std::mt19937 random(11);
  const cv::Mat floor = drawn_floor(200, 160, 150.0);
  const Eigen::Vector2d middle_px(100.3, 80.2);
  cv::Mat mean = cv::Mat::zeros(floor.size(), CV_64F);
  for (int k = 0; k < kMoments; ++k) {
    cv::Mat moment = floor.clone();
    const double share = (k + 0.5) / kMoments - 0.5;
    draw_disc(moment, middle_px.x() + kSlid_px * share, middle_px.y(), 30.0, 30.0, 0.0, 60.0);
    moment.convertTo(moment, CV_64F);
    mean += moment / kMoments;
  }
  cv::Mat picture, plate;
  mean.convertTo(picture, floor.type());
  floor.convertTo(plate, CV_8U);
  const cv::Mat luma = developed(picture, 1.0, random);
  const auto at = [&](double x_px) {
    data::Pose<> pose;
    pose.centre_m = camera.table_from_image({x_px, middle_px.y()}, 0.001);
    return pose;
  };
  const OutlineFitter fitter(body, {data::SupportKind::flat, {}}, camera);
  const auto seen = fitter.measure({.luma = luma,
                                    .background = plate,
                                    .detection = {},
                                    .predicted = at(middle_px.x() + 1.0),
                                    .previous = at(middle_px.x() + 1.0 - 2.0 * kSlid_px),
                                    .exposure_fraction = 0.5});
  ASSERT_TRUE(seen);
  // A hundredth of the way.
  EXPECT_NEAR(seen->centre_px.x(), middle_px.x(), 0.1);
  EXPECT_NEAR(seen->centre_px.y(), middle_px.y(), 0.1);
}

// The light comes from the left: the rounded rim of a grey disc, a third of a pixel wide, is an
// eighth brighter there and as much darker on the right. Nothing in the picture tells that from a
// disc farther right, so the error has to be allowed for.
TEST(OutlineFitter, ARoundedRimLitFromOneSideIsAllowedFor) {
  constexpr double kRadius_px = 30.0, kSliver_px = 0.33, kBrighter = 0.125, kSpread_px = 0.7;
  constexpr double kFace = 150.0, kFloor = 190.0;  // levels
  const data::Body body = flat_disc();
  const auto camera = data::Camera::from_scale(200, 160, 1000.0);
  const auto light_of = [](double level) { return std::pow((level / 255.0 + 0.055) / 1.055, 2.4); };
  const auto level_of = [](double light) {
    return 255.0 * (1.055 * std::pow(light, 1.0 / 2.4) - 0.055);
  };
  const Eigen::Vector2d middle_px(100.3, 80.2);
  cv::Mat picture(160, 200, CV_64F);
  for (int y = 0; y < picture.rows; ++y)
    for (int x = 0; x < picture.cols; ++x) {
      const Eigen::Vector2d off = Eigen::Vector2d(x, y) - middle_px;
      const auto inside = [&](double radius_px) {
        return 0.5 * std::erfc((off.norm() - radius_px) / (kSpread_px * std::sqrt(2.0)));
      };
      const double disc = inside(kRadius_px), face = inside(kRadius_px - kSliver_px);
      const double rim = 1.0 - kBrighter * off.x() / std::max(off.norm(), 1.0);
      picture.at<double>(y, x) = level_of((1.0 - disc) * light_of(kFloor) +
                                          (face + (disc - face) * rim) * light_of(kFace));
    }
  std::mt19937 random(13);
  data::Pose<> pose;
  pose.centre_m = camera.table_from_image(middle_px, 0.001);
  const OutlineFitter fitter(body, {data::SupportKind::flat, {}}, camera);
  const auto seen = fitter.measure({.luma = developed(picture, 0.5, random),
                                    .background = {},
                                    .detection = {},
                                    .predicted = pose});
  ASSERT_TRUE(seen);
  constexpr double kLikely = 2.5;  // standard deviations
  const double error_px = seen->centre_px.x() - middle_px.x();
  EXPECT_GT(error_px, 0.03);
  EXPECT_LT(error_px, kLikely * std::sqrt(seen->covariance_px2(0, 0)));
}

// Grey beside grey mixes in the luma as light does; blue beside white does not: half blue (62, 95,
// 171), half white (193) is (147, 155, 182) by the sRGB curve, of luma 156, where the luma of the
// two, 94 and 193, lets one expect 154.
TEST(Colours, LumaMixesColoursWrongly) {
  const double dark = 255.0 * std::pow((94.0 / 255.0 + 0.055) / 1.055, 2.4);
  const double bright = 255.0 * std::pow((193.0 / 255.0 + 0.055) / 1.055, 2.4);
  EXPECT_NEAR(mixing_error({}, dark, bright), 0.0, 1e-6);
  const Tints blue{{43.3 / 94.0, -22.8 / 94.0}, {}};
  const double middle = 255.0 * std::pow((156.0 / 255.0 + 0.055) / 1.055, 2.4);
  const double expected = (middle - 0.5 * (dark + bright)) / (bright - dark);
  constexpr double kOfALevel = 0.01;
  EXPECT_NEAR(mixing_error(blue, dark, bright), expected, kOfALevel);
}

// Leaving the common part as it is.
TEST(PoseMeasurement, InflationActsOnTheScatterOnly) {
  PoseMeasurement m;
  m.covariance_m2 = 5.0 * Eigen::Matrix2d::Identity();
  m.covariance_px2 = 7.0 * Eigen::Matrix2d::Identity();
  m.common.m2 = m.common.px2 = Eigen::Matrix2d::Identity();
  m.inflation = 2.0;
  m.inflate(4.0);
  EXPECT_DOUBLE_EQ(m.covariance_m2(0, 0), 2.0 * 4.0 + 1.0);
  EXPECT_DOUBLE_EQ(m.covariance_px2(1, 1), 2.0 * 6.0 + 1.0);
}

}  // namespace
}  // namespace trochoid::tracking
