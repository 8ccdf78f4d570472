#include "link/track_notes.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace trochoid::tracking {
namespace {

using testing::HasSubstr;
using testing::Not;

/// A round of 100 px radius in two seconds of 80 pictures, from the fortieth on so many pictures
/// later than it is timed.
data::Track round_with(int pictures) {
  data::Track track;
  for (int i = 0; i < 80; ++i) {
    data::TrackSample& sample = track.samples.emplace_back();
    sample.frame = i;
    sample.t_s = 0.025 * i;
    const double turned = 3.14 * 0.025 * (i + (i >= 40 ? pictures : 0));
    sample.centre_px = {100.0 * std::cos(turned), 100.0 * std::sin(turned)};
    sample.centre_px.x() += i % 2 == 0 ? 0.02 : -0.02;
  }
  return track;
}

TEST(TrackNotes, APictureThatIsMissingIsNamedWithThoseKnown) {
  const auto note = note_about_steps(round_with(1), {60, 20});
  ASSERT_TRUE(note);
  EXPECT_THAT(*note, HasSubstr("missing_frames = [20, 40, 60] puts"));
  EXPECT_FALSE(note_about_steps(round_with(0), {60, 20}));
}

TEST(TrackNotes, APictureThatCameTwiceIsNotOneThatIsMissing) {
  const auto note = note_about_steps(round_with(-1), {});
  ASSERT_TRUE(note);
  EXPECT_THAT(*note, Not(HasSubstr("missing_frames")));
}

}  // namespace
}  // namespace trochoid::tracking
