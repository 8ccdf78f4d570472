#include "trochoid/tracking/smooth.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

namespace trochoid::tracking {
namespace {

constexpr int kSmoothed = 400;
constexpr double kRate_hz = 120.0, kSigma = 0.1;

double truth(double t_s) {
  return 3.0 * std::sin(4.0 * t_s) + 0.5 * t_s;
}

/// A noisy sine; frames for which `hidden` says so are not measured.
struct Noisy {
  std::vector<double> t_s, value, sigma;
  explicit Noisy(const std::function<bool(int)>& hidden) {
    std::mt19937 random(8);
    std::normal_distribution<double> noise(0.0, kSigma);
    for (int i = 0; i < kSmoothed; ++i) {
      t_s.push_back(i / kRate_hz);
      value.push_back(hidden(i) ? std::nan("") : truth(t_s.back()) + noise(random));
      sigma.push_back(hidden(i) ? std::nan("") : kSigma);
    }
  }
};

TEST(Smooth, BeatsTheMeasurementsAndKnowsByHowMuch) {
  const Noisy noisy([](int) { return false; });
  const auto smoothed = smooth(noisy.t_s, noisy.value, noisy.sigma);
  double squares = 0.0, normalised = 0.0;
  for (int i = 0; i < kSmoothed; ++i) {
    const auto& s = smoothed[static_cast<std::size_t>(i)];
    const double error = s.value - truth(i / kRate_hz);
    squares += error * error / kSmoothed;
    normalised += error * error / (s.sigma * s.sigma) / kSmoothed;
  }
  EXPECT_LT(std::sqrt(squares), 0.4 * kSigma);
  // About thirty independent errors: a mean square of 1 +- 0.26.
  EXPECT_GT(normalised, 0.4);
  EXPECT_LT(normalised, 1.8);
}

TEST(Smooth, FindsTheNoiseItIsNotTold) {
  Noisy noisy([](int) { return false; });
  const auto told = smooth(noisy.t_s, noisy.value, noisy.sigma);
  noisy.sigma.assign(noisy.sigma.size(), std::nan(""));
  const auto found = smooth(noisy.t_s, noisy.value, noisy.sigma);
  EXPECT_NEAR(found[200].sigma / told[200].sigma, 1.0, 0.3);
}

TEST(Smooth, ErrorsSaidToBeNoneAreNotBelieved) {
  Noisy noisy([](int) { return false; });
  noisy.sigma.assign(noisy.sigma.size(), 0.0);
  const auto believed = smooth(noisy.t_s, noisy.value, noisy.sigma);
  noisy.sigma.assign(noisy.sigma.size(), std::nan(""));
  const auto found = smooth(noisy.t_s, noisy.value, noisy.sigma);
  EXPECT_EQ(believed[200].value, found[200].value);
  EXPECT_EQ(believed[200].sigma, found[200].sigma);
  EXPECT_GT(found[200].sigma, 0.0);
}

TEST(Smooth, BridgesAGapWithASigmaThatGrows) {
  const Noisy noisy([](int i) { return i >= 200 && i < 212; });
  const auto smoothed = smooth(noisy.t_s, noisy.value, noisy.sigma);
  EXPECT_NEAR(smoothed[206].value, truth(206 / kRate_hz), 4.0 * smoothed[206].sigma);
  EXPECT_GT(smoothed[206].sigma, 1.2 * smoothed[190].sigma);
}

TEST(SmoothTrack, InterpolatesShortGapsMarksThemAndLeavesLongOnes) {
  data::TrackFile file;
  file.tracks.emplace_back();
  for (int i = 0; i < 120; ++i) {
    if ((i >= 30 && i < 33) || (i >= 60 && i < 100)) continue;
    data::TrackSample sample;
    sample.frame = i;
    sample.t_s = i / kRate_hz;
    sample.centre_px = {100.0 + i, 50.0 + 0.02 * ((i * 7) % 5)};
    file.tracks[0].samples.push_back(sample);
  }
  const SmoothTrack smoothed = smooth_track(file);
  EXPECT_EQ(smoothed.interpolated, 3);
  EXPECT_EQ(smoothed.table.values.rows(), 120 - 40);
  EXPECT_DOUBLE_EQ(smoothed.table.column("interpolated").sum(), 3.0);
  EXPECT_NEAR(smoothed.table.column("x_px")[31], 131.0, 0.05);
}

// A gap of 40 ms is short in any recording.
TEST(SmoothTrack, InterpolatesFortyFramesOfAThousandASecond) {
  data::TrackFile file;
  file.tracks.emplace_back();
  for (int i = 0; i < 120; ++i) {
    if (i >= 40 && i < 80) continue;
    data::TrackSample sample;
    sample.frame = i;
    sample.t_s = 1e-3 * i;
    sample.centre_px = {100.0 + i, 50.0 + 0.02 * ((i * 7) % 5)};
    file.tracks[0].samples.push_back(sample);
  }
  EXPECT_EQ(smooth_track(file).interpolated, 40);
}

TEST(Smooth, TellsHowManySamplesWereTooFewTogether) {
  data::TrackFile file;
  file.tracks.emplace_back();
  for (const int frame : {0, 1, 2, 3, 4, 5, 6, 7, 100, 101, 102}) {
    data::TrackSample sample;
    sample.frame = frame;
    sample.t_s = 0.01 * frame;
    sample.centre_px = {truth(sample.t_s), 0.1 * truth(2.0 * sample.t_s)};
    file.tracks.front().samples.push_back(sample);
  }
  const SmoothTrack smoothed = smooth_track(file);
  EXPECT_EQ(smoothed.table.values.rows(), 8);
  EXPECT_EQ(smoothed.left_out, 3);
}

}  // namespace
}  // namespace trochoid::tracking
