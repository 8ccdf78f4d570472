#include "pose/spin_mark.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>

namespace trochoid::tracking {
namespace {

constexpr double kDisc_levels = 60.0, kMark_levels = 200.0, kFloor_levels = 180.0;

data::Body marked_disc() {
  data::Body body;
  body.radius_m = 0.04;
  body.thickness_m = 0.004;
  body.marks.push_back({.distance_m = 0.027, .size_m = 0.006});
  return body;
}

data::Pose<> lying(double psi_rad) {
  data::Pose<> pose;
  pose.centre_m.z() = 0.002;
  pose.psi_rad = psi_rad;
  return pose;
}

// The disc lying flat, its mark seen at all angles about `psi_rad` that it goes through while the
// shutter is open.
cv::Mat photographed(const data::Body& body, const data::Camera& camera, double psi_rad,
                     double turned_rad) {
  constexpr int kInstants = 200;
  const double px_per_m = camera.fx;
  const auto inside = [](double beyond_px) { return std::clamp(0.5 - beyond_px, 0.0, 1.0); };
  const Eigen::Vector2d centre = camera.image_from_table<double>({0.0, 0.0, 0.004});
  cv::Mat luma(camera.height_px, camera.width_px, CV_8UC1);
  cv::RNG noise(5);
  for (int y = 0; y < luma.rows; ++y)
    for (int x = 0; x < luma.cols; ++x) {
      const Eigen::Vector2d p(x, y);
      double mark = 0.0;
      for (int i = 0; i < kInstants; ++i) {
        const double angle = psi_rad + turned_rad * ((i + 0.5) / kInstants - 0.5);
        const double d = body.marks[0].distance_m;
        const Eigen::Vector2d at =
            camera.image_from_table<double>({d * std::cos(angle), d * std::sin(angle), 0.004});
        mark += inside((p - at).norm() - px_per_m * body.marks[0].size_m) / kInstants;
      }
      const double disc = inside((p - centre).norm() - px_per_m * body.radius_m);
      const double face = kDisc_levels + mark * (kMark_levels - kDisc_levels);
      luma.at<uchar>(y, x) = cv::saturate_cast<uchar>(
          kFloor_levels + disc * (face - kFloor_levels) + noise.gaussian(1.0));
    }
  return luma;
}

class MarkThatTurns : public testing::TestWithParam<double> {};

// Errors are a few thousandths; a sharp mark sought in the smear of 0.8 rad is 0.1 rad off.
TEST_P(MarkThatTurns, IsReadInTheMiddleOfItsExposure) {
  const data::Body body = marked_disc();
  const data::Camera camera = data::Camera::from_scale(200, 200, 2000.0);
  for (const double psi_rad : {0.3, 2.0, -1.1}) {
    const auto reading =
        read_marks(photographed(body, camera, psi_rad, GetParam()), body, camera, lying(psi_rad));
    ASSERT_TRUE(reading) << psi_rad;
    EXPECT_EQ(reading->bright, kMark_levels > kDisc_levels);
    const double off_rad = std::remainder(reading->psi_rad - psi_rad, 2.0 * std::numbers::pi);
    constexpr double kFar_rad = 0.02;
    EXPECT_LT(std::abs(off_rad), kFar_rad) << psi_rad;
    EXPECT_LT(std::abs(off_rad), 4.0 * reading->sigma_rad + 0.002) << psi_rad;
  }
}

INSTANTIATE_TEST_SUITE_P(By, MarkThatTurns, testing::Values(0.0, 0.3, 0.8, 1.3));

TEST(SpinMark, AFaceWithoutItsMarkHasNoAngle) {
  const data::Body body = marked_disc();
  data::Body blank = body;
  blank.marks[0].distance_m = 1.0;  // out of sight
  const data::Camera camera = data::Camera::from_scale(200, 200, 2000.0);
  EXPECT_FALSE(read_marks(photographed(blank, camera, 0.3, 0.0), body, camera, lying(0.3)));
}

}  // namespace
}  // namespace trochoid::tracking
