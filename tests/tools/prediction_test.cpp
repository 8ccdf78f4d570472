#include "common/prediction.hpp"

#include <gtest/gtest.h>

#include <numbers>

namespace trochoid::tools {
namespace {

/// A disc on a pivot that turns at 2 rad/s for 2 s.
PredictedPath turning() {
  PredictedArc arc;
  arc.to_s = 2.0;
  arc.has_spin = true;
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
  EXPECT_TRUE(residuals(file, turning(), 1.0).at(0).empty());
}

// A disc nearly flat with a strong loss: down within a second, and recorded for two.
TEST(Prediction, GoesOnWhereABodyFellFlat) {
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
  const PredictedPath path = replay(fit, file);
  const auto last = path.at(0, 2.0);
  ASSERT_TRUE(last);
  EXPECT_EQ(last->theta_rad, 0.0);
  EXPECT_NEAR(last->centre_m.z(), 0.003, 1e-12);  // half its thickness above the floor
  EXPECT_EQ(path.arcs.front().ended, "");
}

}  // namespace
}  // namespace trochoid::tools
