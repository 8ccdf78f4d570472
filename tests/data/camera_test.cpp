#include "trochoid/data/camera.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>
#include <string>

#include "trochoid/data/error.hpp"

namespace trochoid::data {
namespace {

// Tilted by 20 degrees, all five distortion coefficients on, as strong as a wide lens.
Camera tilted_camera() {
  Camera camera = Camera::overhead(800, 600, 1500.0, 0.8);
  camera.cx = 406.3;
  camera.cy = 293.1;
  camera.fy *= 1.01;
  camera.distortion = {-0.24, 0.07, 0.001, -0.0015, 0.01};
  camera.camera_from_table = Eigen::AngleAxisd(0.35, Eigen::Vector3d::UnitX()).toRotationMatrix() *
                             camera.camera_from_table *
                             Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return camera;
}

TEST(CameraFromScale, PutsTheOriginInTheMiddleAndPointsYUp) {
  const Camera camera = Camera::from_scale(640, 480, 2000.0);
  const auto image = [&](double x, double y, double z) {
    return camera.image_from_table(Eigen::Vector3d(x, y, z));
  };
  EXPECT_EQ(image(0, 0, 0), Eigen::Vector2d(319.5, 239.5));
  EXPECT_TRUE(image(0.01, 0.02, 0.0).isApprox(Eigen::Vector2d(339.5, 199.5)));
  EXPECT_TRUE(image(0.01, 0.02, 0.3).isApprox(image(0.01, 0.02, 0.0))) << "no perspective";
}

// A camera straight above at height H shows a point at height z at scale s H / (H - z).
TEST(CameraOverhead, MagnifiesAsTheClosedFormOfThePinholeSays) {
  constexpr double kScale = 1500.0, kHeight_m = 0.8, kZ_m = 0.03;
  const Camera camera = Camera::overhead(640, 480, kScale, kHeight_m);
  const Eigen::Vector2d image = camera.image_from_table(Eigen::Vector3d(0.05, -0.02, kZ_m));
  const double scale = kScale * kHeight_m / (kHeight_m - kZ_m);
  EXPECT_NEAR(image.x(), 319.5 + 0.05 * scale, 1e-10);
  EXPECT_NEAR(image.y(), 239.5 + 0.02 * scale, 1e-10);
  EXPECT_NEAR(camera.depth_m({0.05, -0.02, kZ_m}), kHeight_m - kZ_m, 1e-15);
  EXPECT_TRUE(camera.position_m().isApprox(Eigen::Vector3d(0, 0, kHeight_m)));
}

// Along the image axis through the principal point radial distortion is a polynomial of one number.
TEST(Camera, DistortsRadiallyAsThePolynomialSays) {
  Camera camera = Camera::overhead(640, 480, 1000.0, 1.0);
  camera.distortion = {-0.2, 0.05, 0.0, 0.0, 0.01};
  const double u = 0.3;
  const double expected =
      1000.0 * u * (1 - 0.2 * u * u + 0.05 * u * u * u * u + 0.01 * std::pow(u, 6));
  const Eigen::Vector2d image = camera.image_from_table(Eigen::Vector3d(u, 0.0, 0.0));
  EXPECT_NEAR(image.x() - camera.cx, expected, 1e-10);
  EXPECT_NEAR(image.y(), camera.cy, 1e-10);
}

TEST(Camera, ReturnsToThePointItProjected) {
  constexpr unsigned kSeed = 7;
  std::mt19937 draw(kSeed);
  std::uniform_real_distribution<double> lateral(-0.15, 0.15), height(0.0, 0.05);
  for (const Camera& camera : {tilted_camera(), Camera::overhead(640, 480, 1500.0, 0.8),
                               Camera::from_scale(640, 480, 1500.0)})
    for (int i = 0; i < 200; ++i) {
      const Eigen::Vector3d point{lateral(draw), lateral(draw), height(draw)};
      const Eigen::Vector2d image = camera.image_from_table(point);
      // Newton ends at rounding: 1e-12 m is 1e-9 px here.
      EXPECT_LT((camera.table_from_image(image, point.z()) - point).norm(), 1e-12)
          << "seed " << kSeed << " draw " << i;
      const Ray ray = camera.ray_from_image(image);
      EXPECT_NEAR(ray.direction.norm(), 1.0, 1e-14);
      EXPECT_LT((point - ray.origin_m).cross(ray.direction).norm(), 1e-12);
    }
}

TEST(Camera, JacobianAgreesWithCentralDifferences) {
  constexpr double kStep_m = 1e-6;
  // Third derivatives are of order f / Z^3 ~ 1e4 px/m^3; times h^2 that is 1e-8 px/m, and rounding
  // of pixels (1e-13 / h) adds 1e-7.
  constexpr double kTolerance_px_per_m = 1e-5;
  for (const Camera& camera : {tilted_camera(), Camera::from_scale(640, 480, 1500.0)}) {
    const Eigen::Vector3d point(0.07, -0.11, 0.02);
    const auto jacobian = camera.jacobian_px_per_m(point);
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d step = kStep_m * Eigen::Vector3d::Unit(axis);
      const Eigen::Vector2d difference = (camera.image_from_table<double>(point + step) -
                                          camera.image_from_table<double>(point - step)) /
                                         (2.0 * kStep_m);
      EXPECT_LT((jacobian.col(axis) - difference).norm(), kTolerance_px_per_m);
    }
  }
}

TEST(Camera, RefusesAPixelBeyondTheFoldOfItsDistortion) {
  Camera camera = Camera::overhead(640, 480, 1000.0, 1.0);
  camera.distortion = {-0.4, 0.0, 0.0, 0.0, 0.0};  // r (1 - 0.4 r^2) peaks at 0.609
  EXPECT_THROW(static_cast<void>(camera.ray_from_image({camera.cx + 700.0, camera.cy})),
               NumericalError);
  EXPECT_NO_THROW(static_cast<void>(camera.ray_from_image({camera.cx + 580.0, camera.cy})));
}

TEST(Camera, RefusesAPlaneItsRayDoesNotMeet) {
  Camera camera = Camera::overhead(640, 480, 1000.0, 1.0);
  EXPECT_THROW(static_cast<void>(camera.table_from_image({300.0, 200.0}, 2.0)), NumericalError);
}

TEST(CameraSize, ThatIsNotTheRecordingsIsRefusedWithBothNames) {
  Camera camera = Camera::from_scale(640, 480, 2000.0);
  EXPECT_NO_THROW(camera.check_size(640, 480, "ring.mp4"));
  camera.file = "lens.json";
  try {
    camera.check_size(1280, 720, "ring.mp4");
    FAIL() << "it is another size";
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(),
                 "lens.json: the camera is for 640 x 480 pictures, ring.mp4 has 1280 x "
                 "720; calibrate the camera at this size");
  }
  try {
    camera.check_size(1280, 960, "ring.mp4");
    FAIL() << "it is another size";
  } catch (const InputError& error) {
    // Pixel centres are whole numbers: half the old picture's width, 319.5, becomes 639.5.
    EXPECT_TRUE(
        std::string(error.what())
            .ends_with("has 1280 x 960; calibrate the camera at this size, or if it is the "
                       "same view scaled, nothing cut off, write a camera file with width "
                       "1280, height 960, fx 4000, fy 4000, cx 639.5, cy 479.5, all else as "
                       "it is"))
        << error.what();
  }
  try {
    camera.check_size(426, 320, "ring.mp4");  // a third smaller, the width rounded
    FAIL() << "it is another size";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("fx 1331.25, fy 1333.333, cx 212.5, cy 159.5"),
              std::string::npos)
        << error.what();
  }
  camera.width_px = 0;  // not known
  EXPECT_NO_THROW(camera.check_size(1280, 720, "ring.mp4"));
}

// Straight above, a turn about the line of sight turns the picture, one about x lowers a side.
TEST(MovedCamera, IsOffByWhatIsSaid) {
  constexpr double kHeight_m = 0.8;
  const Camera camera = Camera::overhead(640, 480, 1500.0, kHeight_m);
  const auto moves = [&](int number, double by, const Eigen::Vector3d& point_m) {
    return Eigen::Vector2d(
        camera.moved(by * Camera::Deviation::Unit(number)).image_from_table<double>(point_m) -
        camera.image_from_table<double>(point_m));
  };
  constexpr double kTurn_rad = 1e-4, kShift_m = 1e-4, kOff_m = 0.1;
  const Eigen::Vector3d right(kOff_m, 0.0, 0.0), up(0.0, kOff_m, 0.0);
  EXPECT_NEAR(moves(2, 3.0, right).x(), 3.0, 1e-12);  // cx
  EXPECT_NEAR(moves(12, kShift_m, right).x(), 1500.0 * kShift_m, 1e-12);
  EXPECT_NEAR(moves(11, kTurn_rad, right).y(), 1500.0 * kOff_m * kTurn_rad, 1e-6);
  // What is up in the picture comes nearer by 0.01 mm, and is seen farther out.
  EXPECT_NEAR(moves(9, kTurn_rad, up).y(), -1500.0 * kOff_m * kOff_m * kTurn_rad / kHeight_m, 1e-5);
  EXPECT_EQ(camera.moved(0.1 * Camera::Deviation::Unit(4)).distortion[0], 0.1);
}

TEST(LikelyDeviations, AddUpToTheCovariance) {
  Camera camera = tilted_camera();
  EXPECT_EQ(camera.likely_deviations().cols(), 0);
  // Of three independent causes, in pixels, radians and metres.
  Eigen::Matrix<double, Camera::kNumbers, 3> causes = decltype(causes)::Zero();
  causes(0, 0) = 2.0, causes(14, 0) = 1e-3;
  causes(9, 1) = 1e-4, causes(13, 1) = -2e-4;
  causes(0, 2) = 0.5, causes(9, 2) = 3e-5;
  camera.covariance = causes * causes.transpose();
  const auto found = camera.likely_deviations();
  ASSERT_EQ(found.cols(), 3);
  const Eigen::MatrixXd sum = found * found.transpose();
  for (int i = 0; i < Camera::kNumbers; ++i)
    for (int k = 0; k < Camera::kNumbers; ++k)
      EXPECT_NEAR(sum(i, k), camera.covariance(i, k),
                  1e-12 * std::sqrt(camera.covariance(i, i) * camera.covariance(k, k)));
}

}  // namespace
}  // namespace trochoid::data
