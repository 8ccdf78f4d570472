#ifdef TROCHOID_HAS_TRACKING
#include "study/tracking_scores.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace trochoid::tools {
namespace {

constexpr double kDeg = 180.0 / std::numbers::pi;

// The second frame lies too flat for its angles to count.
data::Table truth_of(double theta_rad) {
  data::Table truth;
  truth.columns = {"frame", "x_m", "y_m", "x_px", "y_px", "theta_rad", "phi_rad", "psi_rad"};
  truth.values.resize(2, 8);
  truth.values.row(0) << 0, 0.0, 0.0, 100.0, 100.0, theta_rad, 1.0, 2.0;
  truth.values.row(1) << 1, 0.0, 0.0, 100.0, 100.0, 0.1, 1.0, 2.0;
  return truth;
}

data::Track track_of(double theta_rad, double phi_rad) {
  data::Track track;
  for (int frame = 0; frame < 2; ++frame) {
    data::TrackSample sample;
    sample.frame = frame;
    sample.centre_px = {100.0, 100.0};
    sample.theta = {theta_rad, 0.01};
    sample.phi = {phi_rad, 0.02};
    track.samples.push_back(sample);
  }
  return track;
}

data::Body disc() {
  data::Body body;
  body.radius_m = 0.02;
  body.thickness_m = 0.004;
  return body;
}

TEST(TrackingScores, AnglesAreComparedWithTheirOwnErrorBars) {
  const TruthScore s = score_against_truth(track_of(0.63, 1.02), truth_of(0.6), disc(), 30.0);
  EXPECT_NEAR(s.tilt.rms_deg, 0.03 * kDeg, 1e-9);
  EXPECT_NEAR(s.tilt.normalised, 9.0, 1e-9);
  EXPECT_NEAR(s.precession.normalised, 1.0, 1e-9);
  EXPECT_TRUE(std::isnan(s.spin.normalised));
}

TEST(TrackingScores, OfTwoAttitudesThatLookAlikeTheFoldedOnesAreCompared) {
  constexpr double kPi = std::numbers::pi;
  const TruthScore s =
      score_against_truth(track_of(0.62, 1.02 + kPi), truth_of(kPi - 0.6), disc(), 30.0);
  EXPECT_NEAR(s.tilt.normalised, 4.0, 1e-9);
  EXPECT_NEAR(s.precession.normalised, 1.0, 1e-9);
}

// A frame in which the body is hidden counts neither as one to be found nor as found; a sample
// without metres has no bias in them.
TEST(TrackingScores, CountWhatCanBeCompared) {
  data::Table truth = truth_of(0.6);
  truth.columns.emplace_back("vis_frac");
  truth.values.conservativeResize(Eigen::NoChange, 9);
  truth.values.col(8) << 1.0, 0.2;
  data::Track track = track_of(0.6, 1.0);
  track.samples[0].centre_m = {0.002, -0.001};
  const TruthScore s = score_against_truth(track, truth, disc(), 30.0);
  EXPECT_EQ(s.frames, 1);
  EXPECT_EQ(s.found, 1);
  EXPECT_EQ(s.lost, 0);
  EXPECT_NEAR(s.bias_mm.x(), 2.0, 1e-12);
  EXPECT_NEAR(s.bias_mm.y(), -1.0, 1e-12);
}

}  // namespace
}  // namespace trochoid::tools
#endif
