#include "find/rim_fit.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "drawn_clip.hpp"

namespace trochoid::tracking {
namespace {

TEST(Ellipse, AxesAndAngleComeBack) {
  const Ellipse e = Ellipse::from_axes({3, 4}, 20.0, 8.0, 0.7);
  EXPECT_NEAR(e.semi_major_px(), 20.0, 1e-12);
  EXPECT_NEAR(e.semi_minor_px(), 8.0, 1e-12);
  EXPECT_NEAR(e.angle_rad(), 0.7, 1e-12);
}

// Plain floor, noise of 3 levels against a step of 100: sd of a centre coordinate is 0.013 px for
// the best possible estimator on this rim; half-level crossings lose some.
TEST(FitRim, ErrorsAreSmallAndAsLargeAsTheySay) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> fraction(-0.5, 0.5);
  double squares = 0.0, normalised = 0.0;
  constexpr int kTrials = 60;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Eigen::Vector2d centre{60.0 + fraction(random), 50.0 + fraction(random)};
    cv::Mat picture(100, 120, CV_64F, cv::Scalar(150.0));
    draw_disc(picture, centre.x(), centre.y(), 30.0, 18.0, 0.05 * trial, 50.0);
    const cv::Mat luma = developed(picture, 3.0, random);
    const auto fit = fit_rim(luma, Ellipse::from_axes({61, 49}, 31, 18, 0.05 * trial + 0.05),
                             {.reach_px = 5.0, .noise_levels = 3.0});
    ASSERT_TRUE(fit) << trial;
    EXPECT_GT(fit->accepted, 0.9);
    const Eigen::Vector2d error = fit->ellipse.centre_px - centre;
    squares += error.squaredNorm() / 2.0;
    normalised += error.dot(fit->covariance_px2.inverse() * error) / 2.0;
  }
  EXPECT_LT(std::sqrt(squares / kTrials), 0.035);
  // 120 squares: a relative sd of 13 %; the estimate of correlation adds as much again.
  EXPECT_NEAR(normalised / kTrials, 1.0, 0.5);
}

TEST(FitRim, HalfHiddenRimIsHeldByItsKnownShape) {
  cv::Mat picture(100, 120, CV_64F, cv::Scalar(40.0));
  draw_disc(picture, 60.0, 97.0, 17.0, 17.0, 0.0, 160.0);
  std::mt19937 random(6);
  const cv::Mat luma = developed(picture, 2.0, random);
  RimSearch search{.reach_px = 4.0, .noise_levels = 2.0};
  search.known_shape_px = 17.0 * Eigen::Matrix2d::Identity();
  const auto fit = fit_rim(luma, Ellipse::from_axes({61, 96}, 17, 17, 0), search);
  ASSERT_TRUE(fit);
  EXPECT_NEAR(fit->ellipse.centre_px.x(), 60.0, 0.1);
  EXPECT_NEAR(fit->ellipse.centre_px.y(), 97.0, 0.25);
  EXPECT_LT(fit->accepted, 0.7);
}

TEST(FitRim, AnEmptyFloorHasNoRim) {
  std::mt19937 random(8);
  const cv::Mat luma = developed(drawn_floor(120, 100, 120.0), 3.0, random);
  EXPECT_FALSE(fit_rim(luma, Ellipse::from_axes({60, 50}, 20, 20, 0),
                       {.reach_px = 6.0, .noise_levels = 3.0}));
}

}  // namespace
}  // namespace trochoid::tracking
