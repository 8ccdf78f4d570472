#include "trochoid/tracking/tracker.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <malloc.h>

#include <atomic>
#include <limits>
#include <numbers>

#include "drawn_clip.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::tracking {
namespace {

constexpr int kDrawnFrames = 90;

/// Largest distance between track and truth over the frames both have.
double largest_error_px(const data::Track& track,
                        const std::function<Eigen::Vector2d(int)>& truth) {
  double largest = 0.0;
  for (const auto& s : track.samples)
    largest = std::max(largest, (s.centre_px - truth(static_cast<int>(s.frame))).norm());
  return largest;
}

// Rests for a third of the clip, is pushed, rests again: a row in every frame, resting ones too.
TEST(TrackVideo, FollowsADiscThatRestsFirstAndLast) {
  const ScratchFolder folder("rests");
  const auto truth = [](int i) {
    const double t = std::clamp(i - 30, 0, 40);
    return Eigen::Vector2d(50.0 + 2.6 * t, 60.0 + 0.9 * t);
  };
  write_clip(folder / "clip.mkv", drawn_floor(220, 160, 150.0), kDrawnFrames, 2.0,
             [&](cv::Mat& picture, int i) {
               draw_disc(picture, truth(i).x(), truth(i).y(), 16.0, 16.0, 0.0, 50.0);
             });
  const TrackResult result = track_video(folder / "clip.mkv", {}, std::nullopt);
  ASSERT_EQ(result.file.tracks.size(), 1u);
  EXPECT_EQ(result.file.tracks[0].samples.size(), static_cast<std::size_t>(kDrawnFrames));
  EXPECT_LT(largest_error_px(result.file.tracks[0], truth), 0.2);
  EXPECT_FALSE(result.file.tracks[0].samples[0].has_metres()) << "no scale is known";
}

// The floor is filmed for a while before anything enters: longer than what is held in memory.
TEST(TrackVideo, FindsADiscThatComesIntoViewLate) {
  const ScratchFolder folder("late");
  constexpr int kEnters = 150, kLength = 230;
  const auto truth = [](int i) { return Eigen::Vector2d(2.5 * (i - kEnters) - 25.0, 70.0); };
  write_clip(folder / "clip.mkv", drawn_floor(220, 140, 150.0), kLength, 2.0,
             [&](cv::Mat& picture, int i) {
               draw_disc(picture, truth(i).x(), truth(i).y(), 16.0, 16.0, 0.0, 50.0);
             });
  TrackOptions options;
  options.held_bytes = std::size_t{1} << 20;  // 34 of these pictures
  const TrackResult result = track_video(folder / "clip.mkv", {}, std::nullopt, options);
  ASSERT_EQ(result.file.tracks.size(), 1u);
  const auto& samples = result.file.tracks[0].samples;
  EXPECT_LT(largest_error_px(result.file.tracks[0], truth), 0.3);
  EXPECT_GT(samples.front().frame, kEnters);
  EXPECT_LT(samples.front().frame, kEnters + 25) << "wholly in view from 17 on";
  EXPECT_EQ(samples.back().frame, kLength - 1);
}

// Of a frame that is done its sighting remains, without the edges that led to it: a kilobyte, where
// those of this disc would be six.
TEST(TrackVideo, RemembersLittleOfEveryFrame) {
  const ScratchFolder folder("memory");
  constexpr int kLength = 600, kEarly = 200, kLate = 500;
  write_clip(folder / "clip.mkv", drawn_floor(96, 64, 150.0), kLength, 2.0,
             [&](cv::Mat& picture, int i) {
               draw_disc(picture, 48.0 + 25.0 * std::sin(0.05 * i), 32.0 + 8.0 * std::cos(0.07 * i),
                         16.0, 16.0, 0.0, 50.0);
             });
  constexpr int kWindow = 50;  // frames over which what is held goes up and down
  std::size_t early_bytes = 0, late_bytes = 0;
  TrackOptions options;
  options.held_bytes = 1;
  options.progress = [&](std::int64_t done, std::int64_t) {
    const std::size_t bytes = ::mallinfo2().uordblks;
    if (done >= kEarly && done < kEarly + kWindow) early_bytes = std::max(early_bytes, bytes);
    if (done >= kLate && done < kLate + kWindow) late_bytes = std::max(late_bytes, bytes);
  };
  const TrackResult result = track_video(folder / "clip.mkv", {}, std::nullopt, options);
  EXPECT_EQ(result.summary.found, kLength);
  constexpr std::size_t kMost_bytes = 3000;  // a frame
  EXPECT_LT(late_bytes, early_bytes + (kLate - kEarly) * kMost_bytes);
}

// Equal discs meet head on and exchange their motion; the one that stood must not inherit the
// other's name.
TEST(TrackVideo, TwoDiscsKeepTheirNamesThroughACollision) {
  const ScratchFolder folder("collision");
  const auto hit = [](int i) {
    return Eigen::Vector2d(std::min(30.0 + 3.0 * i, 120.0 - 33.0), 70.0);
  };
  const auto stood = [](int i) {
    return Eigen::Vector2d(120.0 + std::max(0.0, 3.0 * (i - 19)), 70.0);
  };
  write_clip(folder / "clip.mkv", drawn_floor(320, 140, 40.0), 70, 2.0,
             [&](cv::Mat& picture, int i) {
               draw_disc(picture, hit(i).x(), hit(i).y(), 16.0, 16.0, 0.0, 160.0);
               draw_disc(picture, stood(i).x(), stood(i).y(), 16.0, 16.0, 0.0, 160.0);
             });
  TrackOptions options;
  options.objects = 2;
  const TrackResult result = track_video(folder / "clip.mkv", {}, std::nullopt, options);
  ASSERT_EQ(result.file.tracks.size(), 2u);
  for (const auto& track : result.file.tracks) {
    EXPECT_EQ(track.samples.size(), 70u);
    const bool is_hit = track.samples.front().centre_px.x() < 80.0;
    // Where the discs touch, each hides the other's rim for a quarter of the turn.
    EXPECT_LT(is_hit ? largest_error_px(track, hit) : largest_error_px(track, stood), 0.6);
  }
}

TEST(TrackVideo, ReadsNoSpinFromTheShadingOfABodyThatTilts) {
  const ScratchFolder folder("tilting");
  write_clip(folder / "clip.mkv", drawn_floor(260, 130, 170.0), kDrawnFrames, 2.0,
             [&](cv::Mat& picture, int i) {
               const double x = 30.0 + 2.2 * i, narrow = 18.0 * (0.75 + 0.2 * std::cos(0.2 * i));
               draw_disc(picture, x, 60.0, 18.0, narrow, 0.1 * i, 60.0);
               draw_disc(picture, x + 8.0, 57.0, 4.0, 3.0, 0.0, 130.0);  // the lamp, mirrored
             });
  const TrackResult result = track_video(folder / "clip.mkv", {}, std::nullopt);
  ASSERT_GT(result.file.tracks.front().samples.size(), 10U);
  for (const data::TrackSample& sample : result.file.tracks.front().samples)
    EXPECT_FALSE(sample.psi) << "frame " << sample.frame;
}

TEST(TrackVideo, ABarInFrontLeavesAGapAndTheDiscIsFoundAgain) {
  const ScratchFolder folder("bar");
  const auto truth = [](int i) {
    return Eigen::Vector2d(25.0 + 2.2 * i, 60.0 + 8.0 * std::sin(0.1 * i));
  };
  write_clip(folder / "clip.mkv", drawn_floor(260, 130, 170.0), kDrawnFrames, 2.0,
             [&](cv::Mat& picture, int i) {
               draw_disc(picture, truth(i).x(), truth(i).y(), 14.0, 14.0, 0.0, 60.0);
               picture.colRange(110, 142) = cv::Scalar(100.0);
             });
  const TrackResult result = track_video(folder / "clip.mkv", {}, std::nullopt);
  const auto& samples = result.file.tracks.at(0).samples;
  EXPECT_LT(samples.size(), static_cast<std::size_t>(kDrawnFrames)) << "hidden frames have no row";
  EXPECT_GT(samples.back().frame, 80) << "found again behind the bar";
  EXPECT_LT(largest_error_px(result.file.tracks[0], truth), 1.0);
}

// A recorder that drops a picture and goes on counting: the disc is a frame's way ahead of its
// time.
TEST(TrackVideo, APictureThatIsMissingUnseenIsToldAndPutRight) {
  const ScratchFolder folder("missing");
  const auto truth = [](int i) {
    const double frame = i < 60 ? i : i + 1;
    return Eigen::Vector2d(25.0 + 2.2 * frame, 60.0 + 8.0 * std::sin(0.1 * frame));
  };
  write_clip(folder / "clip.mkv", drawn_floor(290, 130, 170.0), kDrawnFrames, 2.0,
             [&](cv::Mat& picture, int i) {
               draw_disc(picture, truth(i).x(), truth(i).y(), 14.0, 14.0, 0.0, 60.0);
             });
  const auto remedy = testing::Contains(testing::HasSubstr("missing_frames = [60]"));
  data::Scene scene;
  const TrackResult told = track_video(folder / "clip.mkv", scene, std::nullopt);
  EXPECT_THAT(told.file.notes, remedy);
  scene.camera.missing_frames = {60};
  const TrackResult right = track_video(folder / "clip.mkv", scene, std::nullopt);
  EXPECT_THAT(right.file.notes, testing::Not(remedy));
  const auto& before = told.file.tracks.at(0).samples.back();
  const auto& after = right.file.tracks.at(0).samples.back();
  ASSERT_EQ(before.frame, after.frame);
  const double step_s = before.t_s / static_cast<double>(before.frame);
  EXPECT_NEAR(after.t_s - before.t_s, step_s, 1e-3 * step_s);
}

TEST(TrackVideo, AMarkTellsTheSpinAndARadiusTheScale) {
  const ScratchFolder folder("mark");
  const auto psi = [](int i) { return 0.3 + 0.11 * i; };  // seen from above, anticlockwise
  const auto x = [](int i) { return 50.0 + 1.5 * i; };
  write_clip(folder / "clip.mkv", drawn_floor(240, 120, 60.0), kDrawnFrames, 2.0,
             [&](cv::Mat& picture, int i) {
               draw_disc(picture, x(i), 60.0, 24.0, 24.0, 0.0, 190.0);
               draw_disc(picture, x(i) + 14.0 * std::cos(psi(i)), 60.0 - 14.0 * std::sin(psi(i)),
                         4.0, 4.0, 0.0, 40.0);
             });
  data::Scene scene;
  scene.body.emplace();
  scene.body->radius_m = 0.012;  // 2000 px/m
  scene.support.kind = data::SupportKind::flat;
  const TrackResult result = track_video(folder / "clip.mkv", scene, std::nullopt);
  const auto& samples = result.file.tracks.at(0).samples;
  ASSERT_EQ(samples.size(), static_cast<std::size_t>(kDrawnFrames));
  const double turns = 2.0 * std::numbers::pi;
  const double offset = samples[0].psi->value_rad - psi(0);
  EXPECT_NEAR(offset, turns * std::round(offset / turns), 0.03) << "absolute: the mark's direction";
  for (const auto& s : samples) {
    ASSERT_TRUE(s.psi);
    // A mark is read about the middle of a rim that may be a hundredth of its radius off the axis.
    EXPECT_GE(s.psi->sigma_rad, 0.0099);
    EXPECT_LT(s.psi->sigma_rad, 0.05);
    EXPECT_NEAR(s.psi->value_rad, psi(static_cast<int>(s.frame)) + offset, 0.03);
  }
  const double length_m = (samples.back().centre_m - samples.front().centre_m).norm();
  EXPECT_NEAR(length_m, 1.5 * (kDrawnFrames - 1) / 2000.0, 0.002 * length_m + 1e-4);
}

/// What the notes of a track say of how long the shutter was open [%]; 0: nothing. The disc slides
/// so far from picture to picture, drawn as the mean of many places over part of that.
double told_exposure_percent(double exposure_fraction, double step_px) {
  constexpr int kMoments = 24, kFrames = 44, kHeight = 110;
  const int width = 90 + static_cast<int>(kFrames * step_px);
  const ScratchFolder folder("shutter");
  write_clip(folder / "clip.mkv", drawn_floor(width, kHeight, 170.0), kFrames, 1.0,
             [&](cv::Mat& picture, int i) {
               const cv::Mat floor = picture.clone();
               picture = cv::Mat::zeros(floor.size(), CV_64F);
               for (int k = 0; k < kMoments; ++k) {
                 cv::Mat moment = floor.clone();
                 const double share = exposure_fraction * ((k + 0.5) / kMoments - 0.5);
                 draw_disc(moment, 40.0 + step_px * (i + share), 55.0, 24.0, 24.0, 0.0, 60.0);
                 picture += moment / kMoments;
               }
             });
  data::Scene scene;
  scene.body.emplace();
  scene.body->radius_m = 0.024, scene.body->thickness_m = 0.001;
  scene.support.kind = data::SupportKind::flat;
  data::Camera camera = data::Camera::from_scale(width, kHeight, 1000.0);
  camera.transfer = data::Transfer::linear;
  const std::string says = "edges in motion are smeared ";
  for (const std::string& note : track_video(folder / "clip.mkv", scene, camera).file.notes)
    if (const auto at = note.find(says); at != std::string::npos)
      return std::stod(note.substr(note.find("ms, ", at) + 4));
  return 0.0;
}

// By edges smeared by 3 and 5 px that is known to a tenth.
TEST(TrackVideo, TheSmearOfMovingEdgesTellsHowLongTheShutterWasOpen) {
  EXPECT_NEAR(told_exposure_percent(0.4, 7.0), 40.0, 4.0);
  EXPECT_NEAR(told_exposure_percent(0.7, 7.0), 70.0, 7.0);
  EXPECT_EQ(told_exposure_percent(0.0, 7.0), 0.0);
}

/// A disc that moves down and to the right.
void draw_mover(cv::Mat& picture, int i) {
  draw_disc(picture, 30.0 + 1.5 * i, 30.0 + 0.8 * i, 14.0, 14.0, 0.0, 60.0);
}

// Drawn in levels, as a camera without gamma correction sees it: read as sRGB the edges of a dark
// disc on a bright floor are a quarter of a pixel outside.
TEST(TrackVideo, EdgesOnOneSideOfWhereTheyAreExpectedAreNotedUntilTheCameraIsCalledLinear) {
  const ScratchFolder folder("linear");
  write_clip(folder / "clip.mkv", drawn_floor(200, 120, 200.0), 60, 1.0,
             [](cv::Mat& picture, int i) {
               draw_disc(picture, 40.0 + 1.5 * i, 60.0, 24.0, 24.0, 0.0, 50.0);
             });
  data::Scene scene;
  scene.body.emplace();
  scene.body->radius_m = 0.012;
  scene.body->thickness_m = 1e-4;
  scene.support.kind = data::SupportKind::flat;
  // What the scene says counts, not what the camera's file says.
  data::Camera camera = data::Camera::from_scale(200, 120, 2000.0);
  camera.transfer = data::Transfer::linear;
  const auto notes_for = [&](std::optional<data::Transfer> transfer) {
    scene.camera.transfer = transfer;
    return track_video(folder / "clip.mkv", scene, camera).file.notes;
  };
  EXPECT_THAT(notes_for(data::Transfer::srgb),
              testing::ElementsAre(testing::HasSubstr("towards the brighter side")));
  EXPECT_THAT(notes_for(std::nullopt), testing::IsEmpty());
  EXPECT_THAT(notes_for(data::Transfer::linear), testing::IsEmpty());
}

TEST(TrackVideo, ARollingShutterGivesEverySampleTheTimeOfItsRow) {
  const ScratchFolder folder("rows");
  constexpr int kHeight = 120;
  constexpr double kReadout_s = 0.008;
  write_clip(folder / "clip.mkv", drawn_floor(200, kHeight, 150.0), 60, 2.0, draw_mover);
  data::Scene scene;
  const auto global = track_video(folder / "clip.mkv", scene, std::nullopt).file.tracks.at(0);
  scene.camera.readout_s = kReadout_s;
  const auto rolling = track_video(folder / "clip.mkv", scene, std::nullopt).file.tracks.at(0);
  ASSERT_EQ(rolling.samples.size(), global.samples.size());
  for (std::size_t i = 0; i < global.samples.size(); ++i) {
    const double row = global.samples[i].centre_px.y() / (kHeight - 1);
    EXPECT_NEAR(rolling.samples[i].t_s - global.samples[i].t_s, kReadout_s * row, 1e-9);
  }
}

TEST(TrackVideo, AReadoutLongerThanAPictureIsRefusedBeforeTheFirst) {
  const ScratchFolder folder("readout");
  write_clip(folder / "clip.mkv", drawn_floor(200, 120, 150.0), 20, 2.0, draw_mover);
  data::Scene scene;
  scene.camera.readout_s = 8.0;  // milliseconds
  TrackOptions options;
  options.progress = [](std::int64_t, std::int64_t) { ADD_FAILURE() << "it has begun"; };
  try {
    (void)track_video(folder / "clip.mkv", scene, std::nullopt, options);
    FAIL() << "it is accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(),
                testing::HasSubstr("camera.readout_s = 8 is longer than the 0.01 s from picture to "
                                   "picture; is it in seconds?"));
  }
}

TEST(TrackVideo, HandsOutTheEdgesOfEveryFrameToWhoeverAsks) {
  const ScratchFolder folder("edges");
  write_clip(folder / "clip.mkv", drawn_floor(200, 120, 150.0), 40, 2.0, draw_mover);
  TrackOptions options;
  EXPECT_FALSE(track_video(folder / "clip.mkv", {}, std::nullopt, options).edges);
  options.edges = true;
  const TrackResult result = track_video(folder / "clip.mkv", {}, std::nullopt, options);
  ASSERT_TRUE(result.edges);
  const Eigen::VectorXd frame = result.edges->column("frame");
  for (const data::TrackSample& sample : result.file.tracks.at(0).samples)
    EXPECT_TRUE((frame.array() == static_cast<double>(sample.frame)).any()) << sample.frame;
}

TEST(TrackVideo, KeepsToTheFramesAskedForAndCountsTheRest) {
  const ScratchFolder folder("window");
  write_clip(folder / "clip.mkv", drawn_floor(200, 120, 150.0), 60, 2.0, draw_mover);
  TrackOptions options;
  options.from = "f20";
  options.to = "f49";
  const TrackResult result = track_video(folder / "clip.mkv", {}, std::nullopt, options);
  const auto& samples = result.file.tracks.at(0).samples;
  EXPECT_EQ(samples.front().frame, 20);
  EXPECT_EQ(samples.back().frame, 49);
  EXPECT_EQ(result.summary.frames, 30);
  EXPECT_EQ(result.summary.found, static_cast<std::int64_t>(samples.size()));
  EXPECT_EQ(result.summary.lost, 30 - result.summary.found);
}

TEST(TrackVideo, FollowsTheBodyPointedAt) {
  const ScratchFolder folder("pointed");
  const auto slow = [](int i) { return Eigen::Vector2d(60.0 + 0.5 * i, 95.0); };
  write_clip(folder / "clip.mkv", drawn_floor(240, 130, 150.0), 60, 2.0,
             [&](cv::Mat& picture, int i) {
               draw_mover(picture, 0);
               draw_disc(picture, 60.0 + 2.5 * i, 30.0, 18.0, 18.0, 0.0, 50.0);
               draw_disc(picture, slow(i).x(), slow(i).y(), 14.0, 14.0, 0.0, 60.0);
             });
  data::Scene scene;
  scene.tracking.at_px = slow(0);
  const TrackResult result = track_video(folder / "clip.mkv", scene, std::nullopt);
  EXPECT_LT(largest_error_px(result.file.tracks.at(0), slow), 0.5);
}

// Its outline never moves: it is part of the static background, and nothing but the mark changes.
struct TurningInPlace {
  static constexpr double kX_px = 119.5, kY_px = 64.5, kRadius_px = 48.0, kMark_px = 32.0;
  static double psi_rad(int i) { return 0.12 * i; }
  static void write(const std::filesystem::path& path) {
    write_clip(path, drawn_floor(240, 130, 170.0), kDrawnFrames, 2.0, [](cv::Mat& picture, int i) {
      draw_disc(picture, kX_px, kY_px, kRadius_px, kRadius_px, 0.0, 70.0);
      draw_disc(picture, kX_px + kMark_px * std::cos(psi_rad(i)),
                kY_px - kMark_px * std::sin(psi_rad(i)), 5.0, 5.0, 0.0, 200.0);
    });
  }
};

TEST(TrackVideo, ADiscThatTurnsInPlaceIsFollowedByItsRimWherePointed) {
  const ScratchFolder folder("in_place");
  TurningInPlace::write(folder / "clip.mkv");
  data::Scene scene;
  scene.tracking.at_px = {110.0, 70.0};
  const TrackResult result = track_video(folder / "clip.mkv", scene, std::nullopt);
  const auto& samples = result.file.tracks.at(0).samples;
  ASSERT_EQ(samples.size(), static_cast<std::size_t>(kDrawnFrames));
  EXPECT_LT(largest_error_px(
                result.file.tracks[0],
                [](int) { return Eigen::Vector2d(TurningInPlace::kX_px, TurningInPlace::kY_px); }),
            0.3);
  ASSERT_TRUE(samples.front().psi && samples.back().psi);
  EXPECT_NEAR(samples.back().psi->value_rad - samples.front().psi->value_rad,
              TurningInPlace::psi_rad(kDrawnFrames - 1), 0.05);
}

TEST(TrackVideo, ADiscThatTurnsInPlaceIsFoundByBodyAndCamera) {
  const ScratchFolder folder("in_place_body");
  TurningInPlace::write(folder / "clip.mkv");
  constexpr double kScale_px_m = 1000.0;
  data::Scene scene;
  data::Body& body = scene.body.emplace();
  body.radius_m = TurningInPlace::kRadius_px / kScale_px_m;
  body.thickness_m = 0.001;
  body.marks = {{.distance_m = TurningInPlace::kMark_px / kScale_px_m, .size_m = 0.005}};
  scene.support.kind = data::SupportKind::flat;
  const TrackResult result =
      track_video(folder / "clip.mkv", scene, data::Camera::from_scale(240, 130, kScale_px_m));
  const auto& samples = result.file.tracks.at(0).samples;
  ASSERT_EQ(samples.size(), static_cast<std::size_t>(kDrawnFrames));
  for (const data::TrackSample& sample : samples) {
    ASSERT_TRUE(sample.psi);
    EXPECT_NEAR(sample.psi->value_rad, TurningInPlace::psi_rad(static_cast<int>(sample.frame)),
                0.05);
  }
  EXPECT_LT(largest_error_px(
                result.file.tracks[0],
                [](int) { return Eigen::Vector2d(TurningInPlace::kX_px, TurningInPlace::kY_px); }),
            0.3);
}

// It keeps to its place and looks there as the background does, which it is part of, but for a
// glint: the glint alone must not be all of it that is found.
TEST(TrackVideo, ABodyThatPrecessesInPlaceIsSeenThroughout) {
  const ScratchFolder folder("precesses");
  constexpr double kScale_px_m = 1000.0, kRadius_px = 40.0, kTilt_rad = 0.5;
  const Eigen::Vector2d centre_px(119.5, 79.5);
  write_clip(folder / "clip.mkv", drawn_floor(240, 160, 120.0), kDrawnFrames, 2.0,
             [&](cv::Mat& picture, int i) {
               const bool glints = i % 30 > 25;
               draw_disc(picture, centre_px.x(), centre_px.y(), kRadius_px,
                         kRadius_px * std::cos(kTilt_rad), 0.25 * i, glints ? 230.0 : 140.0);
             });
  data::Scene scene;
  data::Body& body = scene.body.emplace();
  body.radius_m = kRadius_px / kScale_px_m;
  body.thickness_m = 0.0005;
  scene.support.kind = data::SupportKind::floor;
  const TrackResult result =
      track_video(folder / "clip.mkv", scene, data::Camera::from_scale(240, 160, kScale_px_m));
  EXPECT_EQ(result.file.tracks.at(0).samples.size(), static_cast<std::size_t>(kDrawnFrames));
  EXPECT_LT(largest_error_px(result.file.tracks[0], [&](int) { return centre_px; }), 0.5);
}

// What is held in memory at once ends somewhere: of the frames there those that come later know
// better, and of the first ones of the next stretch those before.
TEST(TrackVideo, NoFrameIsDoubtedForWantOfThoseBesideItThatWereHeldAtAnotherTime) {
  const ScratchFolder folder("joins");
  constexpr int kSide = 160, kLength = 55;
  constexpr double kScale_px_m = 1000.0, kRadius_px = 25.0, kOff_px = 30.0;
  const double middle_px = 0.5 * (kSide - 1);
  write_clip(folder / "clip.mkv", drawn_floor(kSide, kSide, 140.0), kLength, 2.0,
             [&](cv::Mat& picture, int i) {
               const double theta = 0.8 + 0.1 * std::sin(0.7 * i), sine = std::sin(theta);
               const double phi = 0.3 * i + 0.5 * std::sin(0.7 * i);
               draw_disc(picture, middle_px + kOff_px * sine * std::cos(phi),
                         middle_px - kOff_px * sine * std::sin(phi), kRadius_px,
                         kRadius_px * std::cos(theta), 0.5 * std::numbers::pi - phi, 60.0);
             });
  data::Scene scene;
  data::Body& body = scene.body.emplace();
  body.radius_m = kRadius_px / kScale_px_m;
  body.thickness_m = 0.0005;
  scene.support.kind = data::SupportKind::pivot;
  scene.support.pivot_m = Eigen::Vector3d::Zero();
  TrackOptions options;
  options.held_bytes = 1;  // 32 pictures, of which 12 are held once more
  const TrackResult result = track_video(
      folder / "clip.mkv", scene, data::Camera::from_scale(kSide, kSide, kScale_px_m), options);
  const auto& samples = result.file.tracks.at(0).samples;
  EXPECT_EQ(samples.size(), static_cast<std::size_t>(kLength));
  for (const data::TrackSample& sample : samples)
    if (sample.frame > 0 && sample.frame < kLength - 1)
      EXPECT_FALSE(sample.doubtful()) << "frame " << sample.frame;
}

/// A disc that wobbles about on its rim, seen from above, 16 px in radius.
data::Scene write_wobbling(const std::filesystem::path& clip, double radius_m) {
  write_clip(clip, drawn_floor(220, 130, 150.0), 60, 2.0, [](cv::Mat& picture, int i) {
    draw_disc(picture, 40.0 + 2.0 * i, 65.0, 16.0, 13.0, 0.2 * i, 60.0);
  });
  data::Scene scene;
  data::Body& body = scene.body.emplace();
  body.radius_m = radius_m;
  body.thickness_m = 1e-4;
  scene.support.kind = data::SupportKind::floor;
  return scene;
}

TEST(TrackVideo, EndsWhereverItIsWhenItsCheckpointThrows) {
  const ScratchFolder folder("checkpoint");
  const data::Scene scene = write_wobbling(folder / "clip.mkv", 0.016);
  struct Stop {};
  std::atomic<int> calls{0};
  int most = std::numeric_limits<int>::max();
  TrackOptions options;
  options.checkpoint = [&] {
    if (++calls > most) throw Stop{};
  };
  const auto track = [&] {
    calls = 0;
    (void)track_video(folder / "clip.mkv", scene, data::Camera::from_scale(220, 130, 1000.0),
                      options);
  };
  track();
  const int all = calls;
  EXPECT_GT(all, 3 * 60) << "every picture is read, followed and gone over again";
  for (const int share : {0, 1, 2, 3}) {
    most = share * all / 4;
    EXPECT_THROW(track(), Stop) << share;
  }
}

TEST(TrackVideo, ABodyOfAnotherSizeAtThePointIsSaidToBe) {
  const ScratchFolder folder("other_size");
  data::Scene scene = write_wobbling(folder / "clip.mkv", 0.040);
  scene.tracking.at_px = {40.0, 65.0};
  try {
    (void)track_video(folder / "clip.mkv", scene, data::Camera::from_scale(220, 130, 1000.0));
    FAIL() << "tracked what is not of this size";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(),
                testing::ContainsRegex("no body of the given size is at the point: .* about 40 px, "
                                       "and what is at the point one of about 1[5-7] px"));
  }
}

TEST(TrackVideo, ABodyOfAFewPixelsIsSaidToBeTooSmall) {
  const ScratchFolder folder("small");
  write_clip(folder / "clip.mkv", drawn_floor(220, 130, 150.0), 60, 2.0,
             [](cv::Mat& picture, int i) {
               draw_disc(picture, 40.0 + 2.0 * i, 65.0, 4.0, 3.0, 0.2 * i, 60.0);
             });
  data::Scene scene;
  data::Body& body = scene.body.emplace();
  body.radius_m = 0.004;
  body.thickness_m = 1e-4;
  scene.support.kind = data::SupportKind::floor;
  try {
    (void)track_video(folder / "clip.mkv", scene, data::Camera::from_scale(220, 130, 1000.0));
    FAIL() << "tracked what is hardly more than a speck";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("about 4.0 px, too few to be found"));
  }
}

// Seen face on, precession and spin are one angle.
TEST(TrackVideo, ADiscOnAPinShowsItsTurnByItsMark) {
  const ScratchFolder folder("pin");
  TurningInPlace::write(folder / "clip.mkv");
  constexpr double kScale_px_m = 1000.0;
  constexpr double kHeight_m = 0.5, kPin_m = 0.02, kTop_m = kPin_m + 0.005;
  const data::Camera camera = data::Camera::overhead(240, 130, kScale_px_m, kHeight_m);
  const double px_per_m = kScale_px_m * kHeight_m / (kHeight_m - kTop_m);
  data::Scene scene;
  data::Body& body = scene.body.emplace();
  body.radius_m = TurningInPlace::kRadius_px / px_per_m;
  body.thickness_m = 0.01;
  body.marks.push_back(
      {.distance_m = TurningInPlace::kMark_px / px_per_m, .size_m = 5.0 / px_per_m});
  scene.support.kind = data::SupportKind::pivot;
  scene.support.pivot_m =
      camera.table_from_image({TurningInPlace::kX_px, TurningInPlace::kY_px}, kPin_m);
  const TrackResult result = track_video(folder / "clip.mkv", scene, camera);
  const auto& samples = result.file.tracks.at(0).samples;
  ASSERT_EQ(samples.size(), static_cast<std::size_t>(kDrawnFrames));
  for (const auto& s : samples) {
    ASSERT_TRUE(s.psi) << s.frame;
    EXPECT_FALSE(s.phi) << s.frame;
    const double off = s.psi->value_rad - TurningInPlace::psi_rad(static_cast<int>(s.frame));
    EXPECT_NEAR(std::remainder(off, 2.0 * std::numbers::pi), 0.0, 0.02) << s.frame;
    EXPECT_LT(s.psi->sigma_rad, 0.05) << s.frame;
  }
}

TEST(TrackVideo, APointOutsideThePictureIsSaidToBe) {
  const ScratchFolder folder("outside");
  TurningInPlace::write(folder / "clip.mkv");
  data::Scene scene;
  scene.tracking.at_px = {5000.0, 3.0};
  try {
    (void)track_video(folder / "clip.mkv", scene, std::nullopt);
    FAIL() << "tracked what nobody can see";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("the point at 5000,3 px is outside the picture"));
  }
}

// An oblique look into the bore of a thick platter: its wall and the floor behind have edges of
// their own, which pass for flat rims.
TEST(TrackVideo, PointedIntoABoreItFollowsTheBoresRim) {
  const ScratchFolder folder("bore");
  const auto bore = [](int i) { return Eigen::Vector2d(90.0 + 0.4 * i, 66.0 + 0.1 * i); };
  write_clip(folder / "clip.mkv", drawn_floor(240, 130, 170.0), 60, 2.0,
             [&](cv::Mat& picture, int i) {
               const double x = bore(i).x(), y = bore(i).y();
               draw_disc(picture, x, y + 3.0, 72.0, 40.0, 0.0, 60.0);
               cv::Mat inside(picture.size(), CV_64F, 105.0);
               draw_disc(inside, x, y + 8.0, 22.0, 12.5, 0.0, 170.0);
               cv::Mat share(picture.size(), CV_64F, 0.0);
               draw_disc(share, x, y, 22.0, 12.5, 0.0, 1.0);
               picture += share.mul(inside - picture);
             });
  data::Scene scene;
  scene.tracking.at_px = bore(0) + Eigen::Vector2d(2.0, -1.0);
  const TrackResult result = track_video(folder / "clip.mkv", scene, std::nullopt);
  EXPECT_GE(result.file.tracks.at(0).samples.size(), 58u);
  EXPECT_LT(largest_error_px(result.file.tracks.at(0), bore), 0.4);
}

TEST(TrackVideo, AWallWithoutABodyIsAnErrorThatHelps) {
  const ScratchFolder folder("empty");
  write_clip(folder / "clip.mkv", drawn_floor(120, 90, 120.0), 20, 2.0, [](cv::Mat&, int) {});
  try {
    (void)track_video(folder / "clip.mkv", {}, std::nullopt);
    FAIL() << "tracked a body that is not there";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("no moving body found"));
  }
}

}  // namespace
}  // namespace trochoid::tracking
