#include "draw/pace.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace trochoid::tools {
namespace {

int pictures_of(Pace pace, const std::vector<double>& steps_s) {
  int count = 0;
  for (const double step_s : steps_s) count += pace.pictures(step_s);
  return count;
}

TEST(Pace, ShowsEvenFramesOnceEach) {
  EXPECT_EQ(pictures_of(Pace(30.0, 2.0), std::vector(100, 1.0 / 30.0)), 100);
}

// 60 frames at 30 Hz, each stamp 6 ms early or late in turns.
TEST(Pace, KeepsTheLengthOfARecordingWhoseStampsJitter) {
  std::vector<double> steps_s;
  for (int k = 0; k < 60; ++k) steps_s.push_back(1.0 / 30.0 + (k % 2 == 0 ? 0.012 : -0.012));
  EXPECT_NEAR(pictures_of(Pace(30.0, 2.0), steps_s), 60, 1);
}

TEST(Pace, ShowsFramesStampedInPairsOnceEach) {
  std::vector<double> steps_s;
  for (int k = 0; k < 60; ++k) steps_s.push_back(k % 2 == 0 ? 0.002 : 0.064);
  EXPECT_NEAR(pictures_of(Pace(1.0 / 0.033, 2.0), steps_s), 60, 1);
}

// A camera that goes down from 30 to 20 Hz for want of light.
TEST(Pace, KeepsTheLengthOfARecordingThatSlowsDown) {
  std::vector<double> steps_s(30, 1.0 / 30.0);
  steps_s.insert(steps_s.end(), 30, 1.0 / 20.0);
  EXPECT_NEAR(pictures_of(Pace(30.0, 2.0), steps_s), 75, 1);
}

TEST(Pace, WaitsWhereFramesWereLost) {
  Pace pace(30.0, 2.0);
  EXPECT_EQ(pace.pictures(1.0 / 30.0), 1);
  EXPECT_EQ(pace.pictures(0.5), 15);
  EXPECT_EQ(pace.pictures(1.0 / 30.0), 1);
}

// A camera that takes six pictures at 100 Hz every three seconds, shown at its mean rate.
TEST(Pace, KeepsTheLengthOfARecordingInBursts) {
  std::vector<double> steps_s;
  for (int k = 0; k < 60; ++k) steps_s.push_back(k % 6 == 5 ? 3.0 : 0.01);
  EXPECT_NEAR(pictures_of(Pace(2.5, 2.0), steps_s), 2.5 * 10 * 3.05, 8);
}

TEST(Pace, CutsALongPauseAndGoesOnAsIfItHadNotBeen) {
  Pace pace(30.0, 2.0);
  EXPECT_EQ(pace.pictures(3600.0), 60);
  EXPECT_EQ(pace.pictures(1.0 / 30.0), 1);
}

TEST(Pace, TakesTimesThatGoBackForNoStep) {
  Pace pace(30.0, 2.0);
  EXPECT_EQ(pace.pictures(-1.0), 1);
}

}  // namespace
}  // namespace trochoid::tools
