#ifdef TROCHOID_HAS_TRACKING
#include "draw/overlay_content.hpp"

#include <gtest/gtest.h>

namespace trochoid::tools {
namespace {

/// Samples at 100 Hz from `seen_s` on, with three missing after the second.
data::Track with_gap(double seen_s, bool numbered) {
  data::Track track;
  for (const int frame : {0, 1, 5, 6, 7}) {
    data::TrackSample sample;
    sample.frame = numbered ? frame : -1;
    sample.t_s = seen_s + 0.01 * frame;
    sample.centre_px = {100.0 + frame, 50.0};
    track.samples.push_back(sample);
  }
  return track;
}

std::vector<bool> frames_with_a_point(const OverlayContent& content, const ObjectPaths& paths) {
  std::vector<bool> seen;
  for (int frame = 0; frame < 9; ++frame)
    seen.push_back(content.observed_in(paths, frame, 0.01 * frame) != nullptr);
  return seen;
}

TEST(OverlayContent, NothingIsSeenNowInAGapNorAfterTheEnd) {
  const std::vector<bool> seen{true, true, false, false, false, true, true, true, false};
  for (const bool numbered : {true, false}) {
    OverlayInput input;
    input.tracks.tracks = {with_gap(0.0, numbered)};
    const OverlayContent content(input, 640, 480);
    EXPECT_EQ(frames_with_a_point(content, content.objects().front()), seen) << numbered;
    for (int frame = 0; frame < 9; ++frame)
      EXPECT_EQ(content.detected(frame, 0.01 * frame), seen[static_cast<std::size_t>(frame)]);
  }
}

// With a rolling shutter two bodies of one frame have times of their own.
TEST(OverlayContent, APointBelongsToItsFrameWhenEverInItItWasSeen) {
  for (const double later_s : {-0.006, -0.002, 0.006}) {
    OverlayInput input;
    input.tracks.tracks = {with_gap(0.0, true), with_gap(later_s, true)};
    const OverlayContent content(input, 640, 480);
    EXPECT_EQ(frames_with_a_point(content, content.objects().back()),
              frames_with_a_point(content, content.objects().front()))
        << later_s;
  }
}

}  // namespace
}  // namespace trochoid::tools
#endif
