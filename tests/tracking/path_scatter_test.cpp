#include "link/path_scatter.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

// Whether a track's covariances hold how it scatters about its own path.
namespace trochoid::tracking {
namespace {

/// Rounds on a circle of 1 mm while drifting, with white noise; one frame in ten is missing if
/// `gaps`.
data::Track circling(double rad_per_frame, double noise_m, double claimed_m, bool gaps = false) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  data::Track track;
  for (int i = 0; i < 300; ++i) {
    const double angle = rad_per_frame * i;
    const Eigen::Vector2d noise{normal(random), normal(random)};
    if (gaps && i % 10 == 9) continue;
    data::TrackSample sample;
    sample.frame = i;
    sample.t_s = 0.01 * i;
    sample.centre_m =
        Eigen::Vector2d(1e-3 * std::cos(angle) + 2e-3 * sample.t_s, 1e-3 * std::sin(angle)) +
        noise_m * noise;
    sample.covariance_m2 = claimed_m * claimed_m * Eigen::Matrix2d::Identity();
    track.samples.push_back(sample);
  }
  return track;
}

double mean_of(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double v : values) sum += v / static_cast<double>(values.size());
  return sum;
}

TEST(PathScatter, CovariancesThatHoldItStay) {
  // The median of some forty overlapping differences is known to a third or so; the least of six.
  for (const double rate : {0.0, 0.1, 0.4})
    EXPECT_LT(mean_of(unclaimed_scatter(circling(rate, 2e-5, 2e-5), Measured::centre)), 1.15)
        << rate;
}

TEST(PathScatter, WhatIsTwiceAsLargeAsClaimedIsSeen) {
  for (const bool gaps : {false, true}) {
    const double factor =
        mean_of(unclaimed_scatter(circling(0.2, 4e-5, 2e-5, gaps), Measured::centre));
    EXPECT_GT(factor, 2.5) << gaps;
    EXPECT_LT(factor, 5.0) << gaps;
  }
}

TEST(PathScatter, ALivelyPathIsNotTakenForIt) {
  EXPECT_LT(mean_of(unclaimed_scatter(circling(0.6, 0.0, 2e-5), Measured::centre)), 1.01);
}

TEST(PathScatter, AFewOutliersAreNotTakenForIt) {
  data::Track track = circling(0.1, 2e-5, 2e-5);
  for (const std::size_t i : {60u, 160u, 260u}) track.samples[i].centre_m.x() += 1e-3;
  EXPECT_LT(mean_of(unclaimed_scatter(track, Measured::centre)), 1.6);
}

TEST(PathScatter, ShortTracksAndUnknownCovariancesSayNothing) {
  data::Track track = circling(0.1, 4e-5, 2e-5);
  track.samples.resize(10);
  EXPECT_EQ(unclaimed_scatter(track, Measured::centre), std::vector<double>(10, 1.0));
  data::Track bare = circling(0.1, 4e-5, 2e-5);
  for (auto& sample : bare.samples) sample.covariance_m2.setConstant(data::TrackSample::kUnknown);
  EXPECT_EQ(unclaimed_scatter(bare, Measured::centre), std::vector<double>(300, 1.0));
}

TEST(PathScatter, AnglesScatterOnTheirOwn) {
  data::Track track = circling(0.1, 2e-5, 2e-5);
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  for (data::TrackSample& sample : track.samples) {
    const double course = 0.3 * std::sin(4.0 * sample.t_s);
    sample.theta = {0.8 + course + 3e-3 * normal(random), 1e-3};
    sample.phi = {5.0 * sample.t_s + course + 1e-3 * normal(random), 1e-3};
  }
  EXPECT_NEAR(mean_of(unclaimed_scatter(track, Measured::theta)), 9.0, 3.0);
  EXPECT_LT(mean_of(unclaimed_scatter(track, Measured::phi)), 1.3);
  EXPECT_EQ(unclaimed_scatter(track, Measured::psi), std::vector<double>(300, 1.0));
}

}  // namespace
}  // namespace trochoid::tracking
