#include "draw/frame_times.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace trochoid::tools {
namespace {

/// A track at 1000 Hz, tracked from frame 10 on, with a gap and one lost picture (frame 16 on).
data::TrackFile slow_motion() {
  data::TrackFile file;
  file.tracks.emplace_back();
  for (const int frame : {10, 11, 12, 14, 15, 16, 17}) {
    data::TrackSample sample;
    sample.frame = frame;
    sample.t_s = 0.001 * (frame + (frame >= 16 ? 1 : 0));
    file.tracks.front().samples.push_back(sample);
  }
  return file;
}

TEST(FrameTimes, FollowTheTrackAndGoOnAtItsRate) {
  const FrameTimes times(slow_motion());
  for (const auto& [frame, t_s] :
       {std::pair(0, 0.0), {10, 0.010}, {13, 0.013}, {16, 0.017}, {20, 0.021}}) {
    EXPECT_NEAR(times.time_of(frame).value(), t_s, 1e-12) << frame;
    EXPECT_NEAR(times.frame_at(t_s).value(), frame, 1e-9) << frame;
  }
  EXPECT_NEAR(times.frame_at(0.016).value(), 15.5, 1e-9);
  EXPECT_TRUE(times.has(14));
  EXPECT_FALSE(times.has(13));
}

// Thirty pictures a second in whole milliseconds, then half as many, and some that were lost.
TEST(FrameTimes, TellTheRateOfACameraThatIsFastAtFirst) {
  data::TrackFile file;
  file.tracks.emplace_back();
  double t_s = 0.0;
  for (int frame = 0; frame < 60; ++frame) {
    data::TrackSample sample;
    sample.frame = frame;
    sample.t_s = 1e-3 * std::round(1e3 * t_s);
    file.tracks.front().samples.push_back(sample);
    t_s += (frame < 30 ? 1.0 : 2.0) / 30.0 + (frame == 10 ? 1.0 : 0.0);
  }
  EXPECT_NEAR(1.0 / FrameTimes(file).usual_step_s(), 30.0, 0.1);
}

// Stamps that a container has written for two pictures at once: their mean rate is the camera's.
TEST(FrameTimes, TellTheRateOfPicturesStampedInPairs) {
  data::TrackFile file;
  file.tracks.emplace_back();
  for (int frame = 0; frame < 60; ++frame) {
    data::TrackSample sample;
    sample.frame = frame;
    sample.t_s = 0.066 * (frame / 2) + 0.002 * (frame % 2);
    file.tracks.front().samples.push_back(sample);
  }
  EXPECT_NEAR(FrameTimes(file).usual_step_s(), 0.033, 1e-6);
}

TEST(FrameTimes, AreUnknownWithoutNumbers) {
  data::TrackFile file = slow_motion();
  for (data::TrackSample& sample : file.tracks.front().samples) sample.frame = -1;
  const FrameTimes times(file);
  EXPECT_FALSE(times.numbered());
  EXPECT_EQ(times.usual_step_s(), 0.0);
  EXPECT_FALSE(times.time_of(3));
  EXPECT_FALSE(times.frame_at(0.01));
}

}  // namespace
}  // namespace trochoid::tools
