#include "link/track_notes.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <map>
#include <string>

namespace trochoid::tracking {
namespace {

using testing::AllOf;
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

// Codecs hold the picture of what rests and renew it with a key frame: it drifts by hundredths of a
// pixel, and leaps by as little.
TEST(TrackNotes, ABodyAtRestWhosePictureIsRenewedHasLostNoPictures) {
  constexpr double kDrift = 1e-3;
  data::Track track = round_with(1);
  for (data::TrackSample& sample : track.samples) sample.centre_px *= kDrift;
  EXPECT_FALSE(note_about_steps(track, {}));
}

// Back at the start of its round from one picture to the next, or with four lost between.
TEST(TrackNotes, ABodyThatIsSomewhereElseAtOnceIsTold) {
  constexpr double kRadius_px = 30.0;
  for (const int lost : {0, 4}) {
    data::Track track = round_with(0);
    for (std::size_t i = 40; i < track.samples.size(); ++i) {
      track.samples[i].centre_px.y() -= 80.0;
      track.samples[i].frame += lost;
    }
    const auto note = note_about_cuts(track, kRadius_px);
    ASSERT_TRUE(note);
    EXPECT_THAT(*note, HasSubstr("from frame " + std::to_string(40 + lost) + " on"));
    EXPECT_TRUE(note_about_cuts(track, 70.0)) << "as far away as a shadow";
    EXPECT_FALSE(note_about_cuts(track, 90.0)) << "within the body";
  }
  EXPECT_FALSE(note_about_cuts(round_with(0), kRadius_px));
  EXPECT_FALSE(note_about_cuts(round_with(1), kRadius_px));
  EXPECT_FALSE(note_about_cuts(round_with(0), 2.0)) << "it goes farther than it is large";
}

// The numbers of pictures that are missing by the file's time stamps are not counted.
TEST(TrackNotes, ABodyThatGoesOnWhilePicturesAreMissingIsNotSomewhereElseAtOnce) {
  constexpr int kPictures = 4;
  constexpr double kRadius_px = 30.0;
  data::Track track = round_with(kPictures);
  EXPECT_TRUE(note_about_steps(track, {}));
  EXPECT_FALSE(note_about_cuts(track, kRadius_px)) << "the steps of its times are told";
  for (std::size_t i = 40; i < track.samples.size(); ++i) track.samples[i].t_s += 0.025 * kPictures;
  EXPECT_FALSE(note_about_steps(track, {}));
  EXPECT_FALSE(note_about_cuts(track, kRadius_px)) << "there was time enough";
}

TEST(TrackNotes, ACameraThatIsKnockedDoesNotTakeTheBodyElsewhere) {
  constexpr double kRadius_px = 30.0;
  constexpr std::size_t kKnocked = 40;
  data::Track track = round_with(0);
  std::map<std::int64_t, PictureShift> shifts;
  for (std::size_t i = 0; i < track.samples.size(); ++i) {
    PictureShift& shift = shifts[track.samples[i].frame];
    if (i >= kKnocked) shift.px = {35.0, -40.0};
    track.samples[i].centre_px += shift.px;
  }
  EXPECT_TRUE(note_about_cuts(track, kRadius_px));
  EXPECT_FALSE(note_about_cuts(as_camera_at_rest_sees(track, shifts), kRadius_px));
}

// "Gets 1 % larger and smaller", where it but grew.
TEST(TrackNotes, AZoomIsToldByHowMuchThePictureChangesInSizeAndATurnByItsAngle) {
  std::map<std::int64_t, PictureShift> shifts;
  for (const std::int64_t frame : {0, 1, 2, 3}) {
    shifts[frame].px = {0.1 * static_cast<double>(frame), 0.0};
    shifts[frame].factor = 1.0 - 0.004 * static_cast<double>(frame);
  }
  EXPECT_THAT(note_about_camera_motion(shifts, 4, true).value_or(""),
              AllOf(HasSubstr("changes by 1.2 % in size"), HasSubstr("at most 0.3 px"),
                    HasSubstr("lock focus and zoom"), Not(HasSubstr("does not tell"))));
  for (auto& [frame, shift] : shifts)
    shift.factor = std::polar(1.0, data::radians(0.2) * static_cast<double>(frame));
  EXPECT_THAT(note_about_camera_motion(shifts, 4, true).value_or(""),
              AllOf(HasSubstr("the camera turns: the picture of the floor turns by 0.6 deg, and"),
                    HasSubstr("fasten the camera")));
  for (auto& [frame, shift] : shifts) shift.factor = 1.0;
  EXPECT_THAT(note_about_camera_motion(shifts, 40, true).value_or(""),
              AllOf(HasSubstr("the camera moves"), HasSubstr("fasten the camera"),
                    HasSubstr("in 36 of 40 frames the floor does not tell")));
  EXPECT_FALSE(note_about_camera_motion({}, 4, true));
}

TEST(TrackNotes, PixelsThatAreNotSquareAreTold) {
  VideoInfo video;
  EXPECT_FALSE(note_about_pixel_aspect(video));
  video.pixel_aspect = 4.0 / 3.0;
  // H.264 refuses the 853 columns that 720 of a wide tape come to.
  EXPECT_THAT(note_about_pixel_aspect(video).value_or(""),
              AllOf(HasSubstr("1.333 times"), HasSubstr("scale=2*round(iw*sar/2):ih,")));
}

/// A body of 20 px radius in a picture of 200 px, seen from frame 40 to frame 99 but for a few.
BodyPath seen_late(double x_px) {
  BodyPath path;
  for (int frame = 40; frame < 100; ++frame) {
    if (frame >= 60 && frame < 64) continue;
    Sighting& seen = path.frames[frame].seen;
    seen.centre_px = {x_px, 100.0};
    seen.rim = Ellipse::from_axes(seen.centre_px, 20.0, 15.0, 0.0);
    seen.accepted = 1.0;
  }
  return path;
}

TEST(TrackNotes, ABodyThatIsLongNotSeenIsToldWithTheReason) {
  VideoInfo video;
  video.width_px = video.height_px = 200;
  const auto why = [&](double x_px, const FramesRead& read) {
    return note_about_lost(seen_late(x_px), read, video).value_or("nothing");
  };
  const std::string where = "frames 0 to 39 (of 0 to 99)";
  EXPECT_THAT(why(100.0, {.last = 99}), AllOf(HasSubstr(where), HasSubstr("stands out")));
  EXPECT_THAT(why(10.0, {.last = 99}), AllOf(HasSubstr(where), HasSubstr("picture's edge")));
  EXPECT_THAT(why(100.0, {.last = 99, .moving_to = 20}), HasSubstr("the camera moves"));
  EXPECT_THAT(why(100.0, {.last = 199}), HasSubstr("frames 0 to 39, 100 to 199 (of 0 to 199)"));
  EXPECT_EQ(why(100.0, {.first = 40, .last = 99}), "nothing");
}

}  // namespace
}  // namespace trochoid::tracking
