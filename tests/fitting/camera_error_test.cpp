#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <cmath>
#include <filesystem>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "common.hpp"
#include "observe/camera_error.hpp"
#include "observe/observed.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/model/predictor.hpp"
#include "values_with.hpp"

namespace trochoid::fitting {
namespace {

// A top of 2.5 nutations, seen through a camera that is off by what its calibration allows, and
// measured by the one that the file holds.
class FilmedByAnUncertainCamera : public testing::Test {
 protected:
  FilmedByAnUncertainCamera()
      : file_(std::filesystem::path(testing::TempDir()) /
              ("trochoid_camera_" + std::to_string(::getpid()) + ".json")) {
    camera_ = data::Camera::overhead(640, 480, 1500.0, 0.7);
    camera_.cx += 5.0;
    camera_.distortion = {-0.2, 0.05, 0.0, 0.0, 0.0};
    camera_.covariance = Eigen::MatrixXd::Zero(data::Camera::kNumbers, data::Camera::kNumbers);
  }
  ~FilmedByAnUncertainCamera() override {
    std::error_code ignored;
    std::filesystem::remove(file_, ignored);
  }
  FilmedByAnUncertainCamera(const FilmedByAnUncertainCamera&) = delete;
  FilmedByAnUncertainCamera& operator=(const FilmedByAnUncertainCamera&) = delete;

  void uncertain(int number, double sigma) { camera_.covariance(number, number) = sigma * sigma; }

  [[nodiscard]] data::Scene scene(bool with_camera = true) const {
    data::Scene out = top();
    data::Camera camera = camera_;
    if (!with_camera) camera.covariance.resize(0, 0);
    data::write_camera(camera, file_);
    out.camera.file = file_.string();
    return out;
  }

  // The table frame is the camera's: a pixel that the true camera shows means to the one of the
  // file what its ray meets, and an axis is turned with the camera.
  [[nodiscard]] data::Track seen(std::mt19937_64& generator, bool with_axis) const {
    using model::Observable;
    std::normal_distribution<double> normal;
    Eigen::VectorXd draw(camera_.covariance.rows());
    for (double& each : draw) each = normal(generator);
    const data::Camera truth =
        camera_.moved(camera_.covariance.diagonal().cwiseSqrt().cwiseProduct(draw));
    const auto predictor = model::make_predictor(top());
    std::vector<double> t_s;
    for (int i = 0; i < kSamples; ++i) t_s.push_back(kDuration_s * i / kSamples);
    model::PredictRequest request;
    request.t_s = t_s;
    request.observables = {Observable::x_m, Observable::y_m, Observable::theta_rad,
                           Observable::phi_rad};
    const Eigen::VectorXd motion =
        predictor->predict(values_with(*predictor, kTruth), request).values;
    data::Track track;
    for (int i = 0; i < kSamples; ++i) {
      const Eigen::Vector4d at = motion.segment<4>(4 * i);
      data::TrackSample sample;
      sample.frame = i;
      sample.t_s = t_s[static_cast<std::size_t>(i)];
      const double height_m = kTruth.at("l_m") * std::cos(at[2]);
      sample.centre_px = truth.image_from_table<double>({at[0], at[1], height_m});
      sample.centre_m = camera_.table_from_image(sample.centre_px, height_m).head<2>();
      sample.centre_m += kNoise_m * Eigen::Vector2d{normal(generator), normal(generator)};
      sample.covariance_m2 = kNoise_m * kNoise_m * Eigen::Matrix2d::Identity();
      if (with_axis) {
        const Eigen::Vector3d axis(std::sin(at[2]) * std::sin(at[3]),
                                   -std::sin(at[2]) * std::cos(at[3]), std::cos(at[2]));
        const Eigen::Vector3d measured =
            camera_.camera_from_table.transpose() * truth.camera_from_table * axis;
        sample.theta = {std::acos(measured.z()) + kNoise_rad * normal(generator), kNoise_rad};
        sample.phi = {std::atan2(measured.x(), -measured.y()) + kNoise_rad * normal(generator),
                      kNoise_rad};
      }
      track.samples.push_back(sample);
    }
    return track;
  }

  // Mean square over seeds of what parameters are off by in their own standard deviations.
  [[nodiscard]] double mean_square(const std::vector<std::string>& names, bool with_axis,
                                   const data::Scene& scene) const {
    constexpr int kSeeds = 20;
    double sum = 0.0;
    for (int seed = 0; seed < kSeeds; ++seed) {
      std::mt19937_64 generator(static_cast<std::uint64_t>(seed));
      const data::Fit result = fit_of(seen(generator, with_axis), scene);
      EXPECT_TRUE(result.converged) << result.reason;
      for (const std::string& name : names)
        sum += std::pow(pull(result, name, kTruth.at(name)), 2) /
               (kSeeds * static_cast<double>(names.size()));
    }
    return sum;
  }

  static constexpr int kSamples = 150;
  static constexpr double kDuration_s = 25.0, kNoise_m = 1e-4, kNoise_rad = 1e-3;
  inline static const std::map<std::string, double> kTruth{{"a_1_s2", 0.098},
                                                           {"b_1_s", 0.75},
                                                           {"l_m", 0.1},
                                                           {"theta_rad", M_PI / 3.0},
                                                           {"omega_s_rad_s", 3.0}};
  data::Camera camera_;
  std::filesystem::path file_;
};

// The mean of 20 squares scatters by a third; what is common to all samples is allowed for besides,
// which makes it less.
constexpr double kLeast = 0.2, kMost = 2.0;

TEST_F(FilmedByAnUncertainCamera, LengthsAreKnownAsWellAsTheFocalLength) {
  uncertain(0, 5.0);
  uncertain(1, 5.0);
  uncertain(4, 0.005);
  EXPECT_GT(mean_square({"l_m"}, false, scene(false)), 10.0);
  const double honest = mean_square({"l_m"}, false, scene());
  EXPECT_GT(honest, kLeast);
  EXPECT_LT(honest, kMost);
}

// Turned about the table's origin, where the pivot is, it shifts what is high above that.
TEST_F(FilmedByAnUncertainCamera, WhereItLooksIsInTheErrorBarsOfAnglesAndPath) {
  for (const int turn : {9, 10, 11}) uncertain(turn, 1e-2);
  const std::vector<std::string> names{"a_1_s2", "theta_rad"};
  EXPECT_GT(mean_square(names, true, scene(false)), 2.5);
  const double honest = mean_square(names, true, scene());
  EXPECT_GT(honest, kLeast);
  EXPECT_LT(honest, kMost);
}

TEST_F(FilmedByAnUncertainCamera, IsHeededWhateverElseTheTrackHolds) {
  uncertain(0, 5.0);
  uncertain(1, 5.0);
  std::mt19937_64 generator(1);
  const data::Track track = seen(generator, false);
  const auto sigma_m = [&](const data::Track& each) {
    return fit_of(each, scene()).find("l_m")->sigma;
  };
  const double sigma = sigma_m(track);
  constexpr double kSame = 0.05;  // without pixels no offset of the tracker is allowed for
  data::Track with_a_slip = track;
  with_a_slip.samples[70].centre_m.x() = 40.0;  // farther than its distortion holds
  EXPECT_NEAR(sigma_m(with_a_slip), sigma, kSame * sigma);
  data::Track without_pixels = track;
  for (data::TrackSample& sample : without_pixels.samples) sample.centre_px.setConstant(NAN);
  EXPECT_NEAR(sigma_m(without_pixels), sigma, kSame * sigma);
}

TEST_F(FilmedByAnUncertainCamera, IsMissedWhereItHasGone) {
  std::mt19937_64 generator(1);
  data::Scene gone = scene();
  gone.camera.file += ".gone";
  EXPECT_THAT(fit_of(seen(generator, false), gone).warnings,
              testing::Contains(testing::HasSubstr("the camera is not there")));
}

TEST_F(FilmedByAnUncertainCamera, IsNamedWhereItMakesUpMostOfAnErrorBar) {
  uncertain(0, 5.0);
  uncertain(1, 5.0);
  std::mt19937_64 generator(1);
  const data::Track track = seen(generator, false);
  EXPECT_THAT(fit_of(track, scene()).warnings,
              testing::Contains(testing::HasSubstr("camera's calibration")));
  EXPECT_THAT(fit_of(track, scene(false)).warnings,
              testing::Not(testing::Contains(testing::HasSubstr("camera's calibration"))));
}

// Tilt, precession and spin of R = Rz(phi) Rx(theta) Rz(psi).
Eigen::Vector3d angles_of(const Eigen::Matrix3d& attitude) {
  const Eigen::Vector3d axis = attitude.col(2);
  return {std::acos(axis.z()), std::atan2(axis.x(), -axis.y()),
          std::atan2(attitude(2, 0), attitude(2, 1))};
}

// At the table's origin, which such a camera shows where it did, a body is seen turned.
TEST(CameraShifts, TurnAnglesAsRotationsDo) {
  constexpr double kTurn_rad = 1e-5;
  data::Camera camera = data::Camera::overhead(640, 480, 1500.0, 0.7);
  const Eigen::Vector3d turn = kTurn_rad * Eigen::Vector3d(1.0, -0.5, 0.7);
  data::Camera::Deviation by = data::Camera::Deviation::Zero();
  by.segment<3>(9) = turn;
  camera.covariance = by * by.transpose();
  const Eigen::Matrix3d seen_turned =
      camera.moved(by).camera_from_table.transpose() * camera.camera_from_table;
  data::Track track;
  std::vector<Eigen::Vector3d> wanted;
  for (const double theta : {0.05, 0.4, 1.2, 2.2, 3.05})
    for (const double phi : {-2.0, 0.3, 1.9}) {
      const Eigen::Matrix3d attitude = (Eigen::AngleAxisd(phi, Eigen::Vector3d::UnitZ()) *
                                        Eigen::AngleAxisd(theta, Eigen::Vector3d::UnitX()) *
                                        Eigen::AngleAxisd(0.8, Eigen::Vector3d::UnitZ()))
                                           .toRotationMatrix();
      wanted.emplace_back(angles_of(seen_turned * attitude) - angles_of(attitude));
      data::TrackSample sample;
      sample.t_s = static_cast<double>(wanted.size());
      sample.centre_m.setZero();
      sample.covariance_m2 = 1e-12 * Eigen::Matrix2d::Identity();
      sample.theta = {theta, 1e-6};
      sample.phi = {phi, 1e-6};
      sample.psi = {0.8, 1e-6};
      track.samples.push_back(sample);
    }
  std::vector<ArcData> arcs{make_arc(track, 0, static_cast<int>(wanted.size()),
                                     {.position = true, .theta = true, .phi = true, .psi = true},
                                     false)};
  note_camera_shifts(camera, {}, false, arcs);
  ASSERT_EQ(arcs[0].camera_shifts.size(), 1U);
  const CameraShifts& shifts = arcs[0].camera_shifts[0];
  const double sign = shifts(0, 2) * wanted[0][0] > 0.0 ? 1.0 : -1.0;  // of a deviation: either
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    const double sine = std::sin(track.samples[i].theta->value_rad);
    constexpr double kSecondOrder = 0.01;  // turns of 1e-5 bend angles by 1e-5 / sine of theirs
    const double near = kSecondOrder * kTurn_rad / sine;
    EXPECT_NEAR(sign * shifts(row, 2), wanted[i][0], near) << i;
    EXPECT_NEAR(sign * shifts(row, 3) / sine, wanted[i][1], near) << i;
    EXPECT_NEAR(sign * shifts(row, 4), wanted[i][2], near) << i;
  }
}

// A body that looked a per cent larger than it is made the camera see a per cent less of the floor.
TEST_F(FilmedByAnUncertainCamera, APriorOnTheRadiusThatToldTheCameraIsOneOnAllLengths) {
  const auto predictor = model::make_predictor(top());
  for (const bool by_radius : {false, true}) {
    camera_.metres_by_radius = by_radius;
    data::Scene filmed = scene();
    filmed.body.emplace().radius_m = 0.03;
    filmed.fit.prior["radius_m"] = {0.03, 0.0003};
    EXPECT_EQ(observed(*predictor, filmed, 0.01) != nullptr, by_radius);
    EXPECT_EQ(filmed.fit.prior.contains(kScale), by_radius);
    if (!by_radius) continue;
    EXPECT_NEAR(filmed.fit.prior.at(kScale).sigma, 0.01, 1e-9);
  }
}

}  // namespace
}  // namespace trochoid::fitting
