#include "common/prediction.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "common/fit_job.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/table.hpp"
#include "trochoid/model/simulate.hpp"

namespace trochoid::tools {
namespace {

/// A disc on a pivot that turns at 2 rad/s for 2 s.
PredictedPath turning() {
  PredictedArc arc;
  arc.to_s = 2.0;
  for (const double t_s : {0.0, 1.0, 2.0}) {
    arc.t_s.push_back(t_s);
    data::Pose<> pose;
    pose.psi_rad = 2.0 * t_s;
    arc.pose.push_back(pose);
  }
  return {.model = "pivot", .arcs = {arc}};
}

data::TrackSample seen(double t_s, double psi_rad) {
  data::TrackSample sample;
  sample.t_s = t_s;
  sample.centre_m = {0.01, 0.02};
  sample.psi = {psi_rad, 1e-3};
  return sample;
}

TEST(Prediction, AWholeTurnMoreIsNoErrorOfASpinAngle) {
  for (const double turns : {-3.0, 0.0, 1.0}) {
    const auto off =
        spin_residual_rad(seen(1.0, 2.1 + 2.0 * std::numbers::pi * turns), 0, turning());
    ASSERT_TRUE(off);
    EXPECT_NEAR(*off, 0.1, 1e-12);
  }
}

TEST(Prediction, SaysNothingOfASpinThatIsNotSeenOrNotPredicted) {
  EXPECT_FALSE(spin_residual_rad(seen(3.0, 6.0), 0, turning()));
  data::TrackSample blind = seen(1.0, 2.0);
  blind.psi.reset();
  EXPECT_FALSE(spin_residual_rad(blind, 0, turning()));
}

TEST(Prediction, TheGivenPlaceOfAPivotIsNotJudged) {
  data::TrackFile file;
  file.tracks = {{.object = 0, .samples = {seen(1.0, 2.0)}}};
  EXPECT_TRUE(residuals(file, turning()).at(0).empty());
}

// A disc nearly flat with a strong loss, down within a second, and recorded for two.
struct Falling {
  data::Fit fit;
  data::TrackFile file;
};

Falling falling() {
  data::Fit fit;
  fit.model = "rolling";
  fit.scene_toml = R"([body]
kind = "disc"
radius_m = 0.0375
thickness_m = 0.006
mass_kg = 0.07
[support]
kind = "floor"
[model]
name = "rolling"
rolling_friction_m = 5e-3
[start]
theta_rad = 0.1
w2_rad_s = 10.0
)";
  fit.arcs = {{.track = 0, .object = 0, .from_s = 0.0, .to_s = 2.0, .samples = 3}};
  data::TrackFile file;
  file.tracks = {{.object = 0, .samples = {seen(0.0, 0.0), seen(1.0, 0.0), seen(2.0, 0.0)}}};
  return {fit, file};
}

TEST(Prediction, GoesOnWhereABodyFellFlat) {
  const auto [fit, file] = falling();
  const PredictedPath path = replay(fit, file);
  const auto last = path.at(0, 2.0);
  ASSERT_TRUE(last);
  EXPECT_EQ(last->theta_rad, 0.0);
  EXPECT_NEAR(last->centre_m.z(), 0.003, 1e-12);  // half its thickness above the floor
  EXPECT_EQ(path.arcs.front().ended, "");
}

TEST(Prediction, PutsABodyAsHighAsItsPriorSays) {
  auto [fit, file] = falling();
  fit.scene_toml += "[fit]\nprior = { thickness_m = [0.01, 1e-4] }\n";
  const auto last = replay(fit, file).at(0, 2.0);
  ASSERT_TRUE(last);
  EXPECT_NEAR(last->centre_m.z(), 0.005, 1e-12);
}

// --- what the way of measuring adds to a fit
// -------------------------------------------------------

constexpr double kNoise_m = 2e-5;

// How a recording differs from what happened.
struct Measured {
  double scale = 1.0;        // measured over true length
  double rate_factor = 1.0;  // true over measured duration
  double readout_s = 0.0;    // first to last row
};
constexpr double kRows = 1000.0, kPxPerM = 2000.0;

data::TrackFile recorded(const std::string& scene, const Measured& measured) {
  data::Scene true_scene = data::parse_scene(scene, "what happened");
  true_scene.run.rate_hz = 5000.0;
  true_scene.run.until_s = 1.5;
  const model::Trajectory run = model::simulate(true_scene);
  const data::Table table{.header = {}, .columns = run.columns, .values = run.values};
  const Eigen::VectorXd x = table.column("x_m"), y = table.column("y_m");
  const auto at = [](const Eigen::VectorXd& values, double t_s) {
    const double place = t_s * 5000.0;
    const auto i = static_cast<Eigen::Index>(place);
    return std::lerp(values[i], values[i + 1], place - static_cast<double>(i));
  };
  std::mt19937_64 generator(7);
  std::normal_distribution<double> noise(0.0, kNoise_m);
  data::Track track;
  for (int i = 0; i < 120; ++i) {
    const double stamp_s = 0.01 * i;
    const double row_px = 0.5 * kRows - kPxPerM * at(y, measured.rate_factor * stamp_s);
    const double t_s =
        measured.rate_factor * (stamp_s + measured.readout_s * row_px / (kRows - 1.0));
    data::TrackSample sample;
    sample.frame = i;
    sample.t_s = stamp_s;
    sample.centre_px = {0.0, row_px};
    sample.centre_m = measured.scale * Eigen::Vector2d(at(x, t_s), at(y, t_s)) +
                      Eigen::Vector2d{noise(generator), noise(generator)};
    sample.covariance_m2 = kNoise_m * kNoise_m * Eigen::Matrix2d::Identity();
    track.samples.push_back(sample);
  }
  data::TrackFile file;
  file.tracks.push_back(track);
  return file;
}

std::string disc_of(double mass_kg) {
  return fmt::format(
      "[body]\nradius_m = 0.0375\nthickness_m = 0.006\nmass_kg = {}\n"
      "[start]\ntheta_rad = 1.2\nw2_rad_s = 20.0\nw3_rad_s = 5.0\n"
      "[model]\nname = 'rolling'\nair_linear_N_m_s = [2e-5, 2e-5, 0]\n",
      mass_kg);
}

struct Case {
  const char* name;
  Measured measured;
  double mass_kg;  // as the scene of the fit has it
  const char* fit;
};

class ReplayOf : public testing::TestWithParam<Case> {};

// 240 residuals of noise scatter by 5 % about its size; the motion wrongly replayed is off by
// hundreds of times that.
TEST_P(ReplayOf, AFitThatExplainsItsTrackIsAsNearToItAsTheNoise) {
  const Case& its = GetParam();
  const data::TrackFile file = recorded(disc_of(0.07), its.measured);
  const data::Scene scene = data::parse_scene(disc_of(its.mass_kg) + its.fit, "scene");
  const data::Fit fit = fit_job(file.tracks, scene, {}, false);
  ASSERT_TRUE(fit.converged) << fit.reason;
  EXPECT_NEAR(fit.noise_scale, 1.0, 0.2);
  EXPECT_LT(rms_m(residuals(file, replay(fit, file)).at(0)), 1.2 * kNoise_m);
}

INSTANTIATE_TEST_SUITE_P(
    Measuring, ReplayOf,
    testing::Values(
        Case{"AsItIs", {}, 0.07, ""},
        Case{"InLongerMetres", {.scale = 1.05}, 0.07, "[fit]\nfree_scale = true\n"},
        Case{"InSlowMotion",
             {.rate_factor = 100.0 / 105.0},
             0.07,
             "[camera]\nframe_rate_hz = 100\n[fit]\nprior = { frame_rate_hz = [105, 0.5] }\n"},
        Case{"RowByRow",
             {.readout_s = 6e-3},
             0.07,
             "[camera]\nrows = 1000\n[fit]\nfree = ['readout_s']\n"},
        Case{"OfAnotherMass", {}, 0.1, "[fit]\nprior = { mass_kg = [0.07, 0.0001] }\n"}),
    [](const auto& instance) { return instance.param.name; });

}  // namespace
}  // namespace trochoid::tools
