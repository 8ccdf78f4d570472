#include "observe/observations.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "trochoid/data/error.hpp"

namespace trochoid::fitting {
namespace {

constexpr double kRadius_m = 0.1;
constexpr int kFrame = 7;

// Half a circle, seen with its tilt.
data::Track half_circle() {
  data::Track track;
  for (int i = 0; i < 60; ++i) {
    data::TrackSample sample;
    sample.frame = i;
    sample.t_s = i / 60.0;
    sample.centre_m = kRadius_m * Eigen::Vector2d(std::cos(M_PI * i / 59), std::sin(M_PI * i / 59));
    sample.covariance_m2 = Eigen::Matrix2d::Identity() * 1e-8;
    sample.theta = data::MeasuredAngle{0.5, 0.01};
    track.samples.push_back(sample);
  }
  return track;
}

ArcData arc_of(const data::Track& track) {
  return make_arc(track, 0, static_cast<int>(track.samples.size()), {.theta = true}, false);
}

std::string refusal_of(const data::Track& track) {
  try {
    static_cast<void>(arc_of(track));
  } catch (const TrackError& error) {
    return error.what();
  }
  return "taken";
}

// It was passed over, as if no angle had been seen.
TEST(Observations, AnAngleWithoutErrorIsRefusedByFrameAndColumn) {
  data::Track track = half_circle();
  track.samples[kFrame].theta->sigma_rad = 0.0;
  EXPECT_THAT(refusal_of(track), testing::StartsWith("sigma_theta_rad of the sample at t = "));
  EXPECT_THAT(refusal_of(track), testing::HasSubstr("(frame 7) is 0"));
}

TEST(Observations, APositionWithoutErrorIsRefusedByFrameAndColumns) {
  data::Track track = half_circle();
  track.samples[kFrame].covariance_m2.setZero();
  EXPECT_THAT(refusal_of(track), testing::StartsWith("sxx_m2, sxy_m2, syy_m2 of the sample at"));
  EXPECT_THAT(refusal_of(track), testing::HasSubstr("(frame 7)"));
}

// Squares of 1e300 m are no numbers any more.
TEST(Observations, APlaceOnNoTableIsRefusedByFrameAndColumn) {
  for (const double place_m : {1e300, -1e6}) {
    data::Track track = half_circle();
    track.samples[kFrame].centre_m.y() = place_m;
    EXPECT_THAT(refusal_of(track), testing::HasSubstr("(frame 7) lies at y_m = "));
  }
}

TEST(Observations, APathReachesAsFarAsItsOutermostSamples) {
  EXPECT_DOUBLE_EQ(extent_m(arc_of(half_circle())), 2.0 * kRadius_m);
}

// What lies a kilometre off made of every length and velocity something that is hardly determined.
TEST(Observations, APathReachesNoFartherForAGlitchFarAway) {
  data::Track track = half_circle();
  track.samples[kFrame].centre_m.x() = 1e3;
  EXPECT_DOUBLE_EQ(extent_m(arc_of(track)), 2.0 * kRadius_m);
}

// One row without them, and those of all others counted for nothing.
TEST(Observations, APositionWithoutCovarianceLeavesTheOthersTheirs) {
  constexpr double kStated_m = 1e-4, kCareful_m = 1e-5;
  data::Track track = half_circle();
  track.samples[0].covariance_m2 *= std::pow(kCareful_m / kStated_m, 2);
  track.samples[kFrame].covariance_m2.setConstant(NAN);
  const ArcData arc = arc_of(track);
  EXPECT_FALSE(arc.sigma_unknown);
  const auto sigma_m = [&](int sample) {
    for (const Reading& reading : arc.readings)
      if (reading.sample == sample && reading.channel == Channel::position)
        return 1.0 / reading.whitener(1, 1);
    return 0.0;
  };
  EXPECT_DOUBLE_EQ(sigma_m(0), kCareful_m);
  EXPECT_DOUBLE_EQ(sigma_m(kFrame), kStated_m);
  for (data::TrackSample& sample : track.samples) sample.covariance_m2.setConstant(NAN);
  EXPECT_TRUE(arc_of(track).sigma_unknown);
}

}  // namespace
}  // namespace trochoid::fitting
