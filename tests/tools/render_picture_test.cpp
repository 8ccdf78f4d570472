#ifdef TROCHOID_HAS_TRACKING
#include "draw/render_picture.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "trochoid/data/error.hpp"
#include "trochoid/data/outline.hpp"

namespace trochoid::tools {
namespace {

data::Body flat_disc() {
  data::Body body;
  body.radius_m = 0.03;
  body.thickness_m = 1e-6;
  return body;
}

RenderStyle plain() {
  RenderStyle style;
  style.texture = style.gloss = style.noise_levels = style.blur_px = 0.0;
  style.shadow = false;
  return style;
}

// Share of the body in each pixel, from the light of a picture of two colours.
double share(const cv::Mat& light, int y, int x, float floor, float body) {
  return (floor - light.at<cv::Vec3f>(y, x)[1]) / (floor - body);
}

class CameraAbove : public testing::TestWithParam<data::Camera> {};

// A disc flat under a camera looking straight down appears as a circle about its projected centre.
TEST_P(CameraAbove, ShowsTheCentroidOfAFlatDiscAtItsProjectedCentre) {
  const data::Camera& camera = GetParam();
  const PictureRenderer renderer(flat_disc(), camera, plain());
  for (const double shift : {0.0, 0.00031, 0.00077}) {
    data::Pose<> pose;
    pose.centre_m = {0.004 + shift, -0.003 + 0.6 * shift, 5e-7};
    const cv::Mat light = renderer.light({pose});
    const float floor = light.at<cv::Vec3f>(0, 0)[1];
    const Eigen::Vector2d centre = camera.image_from_table<double>(pose.centre_m);
    const float body =
        light.at<cv::Vec3f>(static_cast<int>(centre.y()), static_cast<int>(centre.x()))[1];
    double area = 0.0;
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (int y = 0; y < light.rows; ++y)
      for (int x = 0; x < light.cols; ++x) {
        const double s = share(light, y, x, floor, body);
        area += s;
        sum += s * Eigen::Vector2d(x, y);
      }
    // 190 edge pixels of 64 rays: each share is off by about 0.01, the centroid by 1e-4 px.
    constexpr double kCentroid_px = 0.002, kArea = 3e-4;
    EXPECT_NEAR(sum.x() / area, centre.x(), kCentroid_px);
    EXPECT_NEAR(sum.y() / area, centre.y(), kCentroid_px);
    EXPECT_NEAR(area / (std::numbers::pi * 30.0 * 30.0), 1.0, kArea);
  }
}

INSTANTIATE_TEST_SUITE_P(PictureRenderer, CameraAbove,
                         testing::Values(data::Camera::overhead(200, 160, 1000.0, 1.0),
                                         data::Camera::from_scale(200, 160, 1000.0)),
                         [](const auto& instance) {
                           return instance.index == 0 ? "AtAHeight" : "FarAway";
                         });

// Rows that are read one after the other show the body where it is by then.
TEST(PictureRenderer, GivesEveryRowItsOwnExposure) {
  const data::Camera camera = data::Camera::from_scale(80, 60, 1000.0);
  const PictureRenderer renderer(flat_disc(), camera, plain());
  const auto exposure_of = [](double row_px) {
    data::Pose<> pose;
    pose.centre_m = {row_px < 30.0 ? -0.004 : 0.004, 0.0, 5e-7};
    return std::vector{pose};
  };
  const cv::Mat light = renderer.rolling_light(exposure_of);
  for (const int row : {20, 40})
    EXPECT_EQ(cv::norm(light.row(row), renderer.light(exposure_of(row)).row(row)), 0.0);
  EXPECT_GT(cv::norm(light.row(20), renderer.light(exposure_of(40)).row(20)), 0.1);
}

// The tracker's outline and the renderer's rays know nothing of each other.
TEST(PictureRenderer, HasItsEdgesWhereTheOutlineOfATiltedRingIsPredicted) {
  data::Body body = flat_disc();
  body.kind = data::BodyKind::ring;
  body.inner_radius_m = 0.018;
  body.thickness_m = 0.012;
  data::Camera camera = data::Camera::overhead(240, 200, 1500.0, 0.6);
  camera.distortion = {-0.2, 0.05, 0.0, 0.0, 0.0};
  RenderStyle style = plain();
  style.samples = 16;
  style.ambient = 1.0;  // one colour all over
  const PictureRenderer renderer(body, camera, style);
  data::Pose<> pose;
  pose.theta_rad = 0.9;
  pose.phi_rad = 0.7;
  pose.centre_m = {0.006, 0.004, data::height_on_floor_m(0.9, 0.03, 0.006)};
  const cv::Mat light = renderer.light({pose});
  const float floor = style.floor.y(), dark = style.body.y();
  // A straight edge at distance d from a pixel's centre covers 1/2 - d of it, if along an axis.
  constexpr double kOff_px = 0.02;
  double sum = 0.0;
  int count = 0;
  for (const auto& point : data::visible_outline(body, pose, camera, 1.0)) {
    if (!point.silhouette ||
        std::max(std::abs(point.normal_px.x()), std::abs(point.normal_px.y())) < 0.999)
      continue;
    const int x = static_cast<int>(std::lround(point.image_px.x()));
    const int y = static_cast<int>(std::lround(point.image_px.y()));
    const double inside =
        (point.image_px - Eigen::Vector2d(x, y)).dot(point.normal_px);  // of the edge, outwards
    if (std::abs(inside) > 0.35) continue;
    const double covered = share(light, y, x, floor, dark);
    if (covered < 0.1 || covered > 0.9) continue;  // another edge is near
    sum += covered - (0.5 + inside);
    ++count;
  }
  ASSERT_GT(count, 5);
  EXPECT_NEAR(sum / count, 0.0, kOff_px);
}

TEST(PictureRenderer, ShowsTheMarkWhereTheSpinSays) {
  data::Body body = flat_disc();
  body.marks.push_back({.distance_m = 0.02, .size_m = 0.004});
  const data::Camera camera = data::Camera::overhead(200, 160, 1000.0, 1.0);
  const PictureRenderer renderer(body, camera, plain());
  data::Pose<> pose;
  pose.phi_rad = 0.4;
  pose.psi_rad = 0.8;
  pose.centre_m.z() = 5e-7;
  const cv::Mat light = renderer.light({pose});
  const Eigen::Vector2d at = camera.image_from_table<double>(
      Eigen::Vector3d(0.02 * std::cos(1.2), 0.02 * std::sin(1.2), 0.0));
  const Eigen::Vector2d opposite = camera.image_from_table<double>(
      Eigen::Vector3d(-0.02 * std::cos(1.2), -0.02 * std::sin(1.2), 0.0));
  const auto green = [&](const Eigen::Vector2d& p) {
    return light.at<cv::Vec3f>(static_cast<int>(p.y()), static_cast<int>(p.x()))[1];
  };
  EXPECT_GT(green(at), 5.0F * green(opposite));
}

TEST(PictureRenderer, DrawsABorderFromItsRadiusOutwards) {
  data::Body body = flat_disc();
  body.border_radius_m = 0.024;
  const data::Camera camera = data::Camera::overhead(200, 160, 1000.0, 1.0);
  data::Pose<> pose;
  pose.centre_m.z() = 5e-7;
  const cv::Mat light = PictureRenderer(body, camera, plain()).light({pose});
  const auto green = [&](double from_axis_m) {
    const Eigen::Vector2d p =
        camera.image_from_table<double>(Eigen::Vector3d(from_axis_m, 0.0, 0.0));
    return light.at<cv::Vec3f>(static_cast<int>(p.y()), static_cast<int>(p.x()))[1];
  };
  EXPECT_FLOAT_EQ(green(0.022), green(0.0));
  EXPECT_GT(green(0.026), 5.0F * green(0.0));
  EXPECT_FLOAT_EQ(green(0.026), green(-0.028));
}

// Of a level body the shadow of a lamp aside is as large as its face, whichever its penumbra.
TEST(PictureRenderer, CastsAShadowOfTheSizeOfTheFace) {
  constexpr double kScale = 1000.0, kRadius_m = 0.03, kHeight_m = 0.1;
  const data::Camera camera = data::Camera::from_scale(400, 160, kScale);
  for (const double thickness_m : {0.0, 1e-6})
    for (const double bore_m : {0.0, 0.012})
      for (const double lamp_rad : {0.001, 0.1}) {
        data::Body body = flat_disc();
        body.thickness_m = thickness_m;
        body.inner_radius_m = bore_m;
        if (bore_m > 0.0) body.kind = data::BodyKind::ring;
        RenderStyle style = plain();
        style.shadow = true;
        style.light = {1.0, 0.0, 1.0};
        style.lamp_radius_rad = lamp_rad;
        data::Pose<> pose;
        pose.centre_m = {0.06, 0.0, kHeight_m};
        const cv::Mat light = PictureRenderer(body, camera, style).light({pose});
        const float floor = light.at<cv::Vec3f>(0, 0)[1];
        double area_px2 = 0.0;
        for (int y = 0; y < light.rows; ++y)
          for (int x = 0; x < light.cols / 2; ++x)  // the body is in the other half
            area_px2 += share(light, y, x, floor, static_cast<float>(style.ambient) * floor);
        const double expected_px2 =
            std::numbers::pi * kScale * kScale * (kRadius_m * kRadius_m - bore_m * bore_m);
        // Some 260 pixels on its edges count whole or not at all, an error of 0.3 of one each: 5 of
        // 2375 pixels, and as much again for the lamp's 48 points.
        EXPECT_NEAR(area_px2 / expected_px2, 1.0, 0.01)
            << thickness_m << " m thick, bore " << bore_m << " m, lamp " << lamp_rad;
      }
}

TEST(PictureRenderer, LightsTheUpperFaceOfABodyWithoutThickness) {
  data::Body thin = flat_disc(), none = thin;
  none.thickness_m = 0.0;
  const data::Camera camera = data::Camera::from_scale(200, 160, 1000.0);
  data::Pose<> pose;
  pose.centre_m.z() = 1e-6;
  const auto middle = [&](const data::Body& body) {
    return PictureRenderer(body, camera, plain()).light({pose}).at<cv::Vec3f>(80, 100)[1];
  };
  EXPECT_FLOAT_EQ(middle(none), middle(thin));
}

TEST(PictureRenderer, RepeatsItselfForTheSameSeed) {
  RenderStyle style = plain();
  style.noise_levels = 2.0;
  style.texture = 0.1;
  const data::Camera camera = data::Camera::overhead(64, 48, 1000.0, 1.0);
  const PictureRenderer one(flat_disc(), camera, style), two(flat_disc(), camera, style);
  data::Pose<> pose;
  const cv::Mat a = one.picture(one.light({pose}), 3), b = two.picture(two.light({pose}), 3);
  EXPECT_EQ(cv::norm(a, b, cv::NORM_INF), 0.0);
  EXPECT_GT(cv::norm(a, one.picture(one.light({pose}), 4), cv::NORM_INF), 0.0);
}

TEST(PictureRenderer, RefusesABodyWithoutAShape) {
  EXPECT_THROW(PictureRenderer(data::Body{}, data::Camera::overhead(64, 48, 1000.0, 1.0), plain()),
               InputError);
}

}  // namespace
}  // namespace trochoid::tools
#endif
