#include "trochoid/tracking/body_camera.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <random>

#include "calibrate/overhead_fit.hpp"
#include "drawn_clip.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/outline.hpp"
#include "trochoid/data/pose_motion.hpp"

namespace trochoid::tracking {
namespace {

namespace fs = std::filesystem;

const cv::Size kSize(640, 480);
constexpr double kScale_px_per_m = 1000.0, kHeight_m = 0.9;

data::Body disc() {
  data::Body body;
  body.radius_m = 0.04;
  body.thickness_m = 0.008;
  return body;
}

OverheadNumbers numbers(double scale_px_per_m, double height_m) {
  return {std::log(scale_px_per_m), std::log(height_m), 0.0, 0.0, 0.0};
}

// As little as can be known of a camera.
OverheadPrior no_prior() {
  OverheadPrior prior;
  prior.log_focal = std::log(1.3 * kSize.width);
  prior.focal_sigma = 10.0;
  return prior;
}

/// A disc that rolls round in many tilts, as edges of its outline under a known camera, scattered
/// by `noise_px` along their normals and `outside_px` too far out; poses start a little off.
std::vector<SeenOutline> rolling(double noise_px, double outside_px, unsigned seed) {
  const data::Camera camera = overhead_camera(numbers(kScale_px_per_m, kHeight_m), kSize);
  const data::Support floor{data::SupportKind::floor, {}};
  const data::PoseMotion motion(disc(), floor, camera);
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<SeenOutline> all;
  for (int i = 0; i < 40; ++i) {
    data::Pose<> pose;
    pose.centre_m = {0.2 * std::cos(0.9 * i), 0.15 * std::sin(0.7 * i), 0.0};
    pose.theta_rad = 0.3 + 0.025 * i;
    pose.phi_rad = 0.8 * i;
    pose = motion.settled(pose);
    SeenOutline seen{pose, {}};
    for (const auto& point : data::visible_outline(disc(), pose, camera, 5.0)) {
      const double off_px = outside_px + noise_px * normal(random);
      seen.edges.push_back(
          {point.image_px + off_px * point.normal_px, point.normal_px, noise_px, 0.0});
    }
    seen.pose.theta_rad += 0.01 * normal(random);
    seen.pose.centre_m.head<2>() += 2e-4 * Eigen::Vector2d(normal(random), normal(random));
    seen.pose = motion.settled(seen.pose);
    all.push_back(std::move(seen));
  }
  return all;
}

OverheadFit fitted(std::vector<SeenOutline> seen, const OverheadPrior& prior = no_prior()) {
  const data::Support floor{data::SupportKind::floor, {}};
  return fit_overhead(disc(), floor, kSize, prior, numbers(1.02 * kScale_px_per_m, 1.3),
                      std::move(seen));
}

TEST(FitOverhead, FindsTheCameraUnderWhichOutlinesWereMade) {
  const OverheadFit fit = fitted(rolling(0.0, 0.0, 1));
  // Outlines are compared where they are sampled, straight in between: 0.003 px of 40.
  EXPECT_NEAR(std::exp(fit.numbers[kLogScale]) / kScale_px_per_m, 1.0, 3e-4);
  EXPECT_NEAR(std::exp(fit.numbers[kLogHeight]) / kHeight_m, 1.0, 3e-3);
}

TEST(FitOverhead, NoiseOfTheEdgesStaysWithinTheErrorBars) {
  double squares = 0.0;
  constexpr int kDraws = 4;
  for (unsigned seed = 1; seed <= kDraws; ++seed) {
    const OverheadFit fit = fitted(rolling(0.2, 0.0, seed));
    const Eigen::Vector2d off = (fit.numbers - numbers(kScale_px_per_m, kHeight_m)).head<2>();
    squares += off.dot(fit.covariance.topLeftCorner<2, 2>().inverse() * off) / kDraws;
  }
  // Of two numbers; the bars also allow for what all edges share, so that it is less.
  EXPECT_LT(squares, 2.0);
}

TEST(FitOverhead, EdgesThatAllLieTooFarOutStayWithinTheErrorBars) {
  const OverheadFit fit = fitted(rolling(0.05, 0.1, 1));
  const Eigen::Vector2d off = (fit.numbers - numbers(kScale_px_per_m, kHeight_m)).head<2>();
  EXPECT_GT(off[kLogScale], 5e-4);  // a tenth of a pixel of 40, larger
  const Eigen::Vector2d sigma = fit.covariance.diagonal().head<2>().cwiseSqrt();
  EXPECT_LT(std::abs(off[kLogScale]), 1.5 * sigma[kLogScale]);
  EXPECT_LT(std::abs(off[kLogHeight]), 1.5 * sigma[kLogHeight]);
}

TEST(FitOverhead, AHeightByTapeIsHeldAndNarrowsTheScale) {
  OverheadPrior prior = no_prior();
  const OverheadFit alone = fitted(rolling(0.2, 0.0, 3), prior);
  prior.log_height = std::log(kHeight_m);
  prior.height_sigma = 0.001;
  const OverheadFit fit = fitted(rolling(0.2, 0.0, 3), prior);
  EXPECT_NEAR(std::exp(fit.numbers[kLogHeight]) / kHeight_m, 1.0, 0.003);
  EXPECT_LT(fit.covariance(kLogScale, kLogScale), 0.7 * alone.covariance(kLogScale, kLogScale));
}

// A tape that outweighs the outlines shows that it is wrong by what they tell without it.
TEST(FitOverhead, OutlinesTellTheirOwnHeightBesideAWrongTape) {
  for (const double tape_m : {kHeight_m, 5.0 * kHeight_m}) {
    OverheadPrior prior = no_prior();
    prior.focal_sigma = 0.5;
    prior.log_height = std::log(tape_m);
    const OverheadFit fit = fitted(rolling(0.2, 0.0, 3), prior);
    EXPECT_NEAR(std::exp(fit.numbers[kLogHeight]) / tape_m, 1.0, 0.1);
    EXPECT_NEAR(fit.own_log_height, std::log(kHeight_m), 2.0 * fit.own_height_sigma);
    EXPECT_EQ(std::log(tape_m) - fit.own_log_height > 3.0 * fit.own_height_sigma,
              tape_m > kHeight_m);
  }
}

TEST(FitOverhead, EdgesBesideNoOutlineAreRefused) {
  std::vector<SeenOutline> seen = rolling(0.1, 0.0, 1);
  for (SeenOutline& each : seen)
    for (EdgePoint& edge : each.edges) edge.image_px.array() += 300.0;
  EXPECT_THROW((void)fitted(std::move(seen)), NumericalError);
}

// A puck on its face: a circle drawn without any of our geometry. Without walls nothing but the
// prior tells the height, and of the scale just that at the puck's upper face.
TEST(CameraFromBody, ACircleDrawnFlatTellsTheScaleOfItsFace) {
  const ScratchFolder scratch("body_camera");
  const fs::path clip = scratch / "puck.avi";
  constexpr double kRadius_px = 30.0;
  write_clip(clip, drawn_floor(320, 240, 90.0), 40, 1.0, [&](cv::Mat& picture, int i) {
    // Ever faster: the part that is looked at does not begin where the body is pointed at.
    draw_disc(picture, 50.0 + 2.0 * i + 0.06 * i * i, 90.0 + 1.3 * i, kRadius_px, kRadius_px, 0.0,
              200.0);
  });
  data::Scene scene;
  scene.body = data::Body{};
  scene.body->radius_m = 0.02;
  scene.body->thickness_m = 1e-5;
  scene.support.kind = data::SupportKind::flat;
  scene.tracking.at_px = Eigen::Vector2d(50.0, 90.0);
  double done = 0.0;
  BodyCameraOptions options;
  options.progress = [&](double share) {
    EXPECT_GE(share, done);
    done = share;
  };
  const BodyCamera found = camera_from_body(clip, scene, options);
  EXPECT_NEAR(found.scale_px_per_m, kRadius_px / scene.body->radius_m,
              3.0 * found.sigma_scale * found.scale_px_per_m);
  EXPECT_LT(found.sigma_scale, 0.006);  // 0.1 px of 30, and the scatter
  EXPECT_GT(found.sigma_height, 0.3);
  EXPECT_GT(done, 0.5);
  // The camera file holds the same: how far a point at the rim of the picture may be off.
  const Eigen::Vector3d at(0.1, 0.0, 0.0);
  double off_m2 = 0.0;
  const auto deviations = found.camera.likely_deviations();
  for (Eigen::Index k = 0; k < deviations.cols(); ++k)
    off_m2 += (found.camera.moved(1e-3 * deviations.col(k)).image_from_table(at) -
               found.camera.image_from_table(at))
                  .squaredNorm() *
              1e6;
  EXPECT_GT(std::sqrt(off_m2), 0.9 * found.sigma_scale * found.scale_px_per_m * at.x());
}

TEST(CameraFromBody, ABodyThatTellsNoCameraIsRefused) {
  data::Scene scene;
  EXPECT_THROW(check_tells_a_camera(scene), InputError);
  scene.body = disc();
  EXPECT_NO_THROW(check_tells_a_camera(scene));
  scene.body->thickness_m = 0.0;
  EXPECT_THROW(check_tells_a_camera(scene), InputError);
  scene.body = disc();
  scene.support.kind = data::SupportKind::none;
  EXPECT_THROW(check_tells_a_camera(scene), InputError);
  scene.support = {data::SupportKind::pivot, Eigen::Vector3d::Zero()};
  EXPECT_THROW(check_tells_a_camera(scene), InputError);
}

// A rolling disc filmed by a path tracer of another project, with its camera's truth.
TEST(CameraFromBody, ARollingDiscTellsTheCameraThatFilmedIt) {
  const fs::path sample = fs::path(TROCHOID_SOURCE_DIR) / "data/samples/s1_disc_paper";
  data::Scene scene = data::read_scene(sample / "scene.toml");
  scene.tracking.from = "f40";
  scene.tracking.to = "f160";
  const data::Camera truth = data::read_camera(sample / "camera.json");
  BodyCameraOptions options;
  options.height_m = 1.2;
  const BodyCamera found = camera_from_body(sample / "video.mp4", scene, options);
  EXPECT_NEAR(truth.camera_from_table_m.z(), 1.2, 1e-9);
  EXPECT_NEAR(found.scale_px_per_m, truth.fx / 1.2, 3.0 * found.sigma_scale * found.scale_px_per_m);
  EXPECT_LT(found.sigma_scale, 0.01);
}

// Of a sixth of a round of its node line both ways to lean fit nearly as well, and the camera had
// settled beside the wrong one.
TEST(CameraFromBody, ARecordingTooShortToTellTheLeanIsRefused) {
  const fs::path sample = fs::path(TROCHOID_SOURCE_DIR) / "data/samples/s1_disc_paper";
  data::Scene scene = data::read_scene(sample / "scene.toml");
  scene.tracking.to = "f25";
  EXPECT_THROW(static_cast<void>(camera_from_body(sample / "video.mp4", scene)), NumericalError);
}

}  // namespace
}  // namespace trochoid::tracking
