#include "prediction.hpp"

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

}  // namespace
}  // namespace trochoid::tools
