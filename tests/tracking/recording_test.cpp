#include "find/recording.hpp"

#include <gtest/gtest.h>

#include <fmt/core.h>
#include <algorithm>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "drawn_clip.hpp"

namespace trochoid::tracking {
namespace {

// Whoever asks for the first part of a recording need not have the rest of it whole.
TEST(Recording, LooksAheadAsFarAsItCan) {
  constexpr int kPictures = 60, kBroken = 50;
  const ScratchFolder folder("recording");
  for (int i = 0; i < kPictures; ++i)
    cv::imwrite(folder / fmt::format("{:02}.png", i), cv::Mat(48, 64, CV_8U, cv::Scalar(i)));
  std::ofstream(folder / fmt::format("{:02}.png", kBroken), std::ios::trunc);
  constexpr std::size_t kFewest = 1;  // bytes: more pictures than one window follow
  Recording recording(folder / "", {.frame_rate_hz = 100.0, .to = "f45"}, kFewest);
  ASSERT_TRUE(recording.advance(0));
  ASSERT_LT(recording.window().back().index, 45);
  EXPECT_GE(recording.samples().luma.size(), Background::kSamples);
}

// Of pictures that all decode alone a look over the recording decodes some, from all of it: it
// would cost as much as the tracking.
TEST(Recording, LooksOverALongSeriesAtAFewPicturesOfIt) {
  constexpr int kPictures = 240, kMost = 60, kLate = 200;
  const ScratchFolder folder("long_series");
  for (int i = 0; i < kPictures; ++i)
    cv::imwrite(folder / fmt::format("{:03}.png", i), cv::Mat(48, 64, CV_8U, cv::Scalar(i)));
  const auto keys = open_video(folder / "", {.frame_rate_hz = 100.0, .key_frames_only = true});
  int count = 0;
  double latest = 0.0;
  while (const auto frame = keys->next()) ++count, latest = cv::mean(frame->luma)[0];
  EXPECT_LT(count, kMost);
  EXPECT_GT(latest, kLate);
}

TEST(Recording, LooksBeyondAPartThatFitsIntoOneWindow) {
  constexpr int kPictures = 100, kLast = 45;
  const ScratchFolder folder("short_part");
  for (int i = 0; i < kPictures; ++i)
    cv::imwrite(folder / fmt::format("{:02}.png", i), cv::Mat(48, 64, CV_8U, cv::Scalar(i)));
  constexpr std::size_t kAll = 1 << 24;  // bytes
  Recording recording(folder / "", {.frame_rate_hz = 100.0, .to = fmt::format("f{}", kLast)}, kAll);
  ASSERT_TRUE(recording.advance(0));
  ASSERT_EQ(recording.window().back().index, kLast);
  double latest = 0.0;
  for (const cv::Mat& luma : recording.samples().luma) latest = std::max(latest, cv::mean(luma)[0]);
  EXPECT_GT(latest, kLast);
}

TEST(Recording, LeavesOutWhatLiesOutsideOfThePartAskedForWhenToldSo) {
  constexpr int kPictures = 100, kLast = 45;
  const ScratchFolder folder("part");
  for (int i = 0; i < kPictures; ++i)
    cv::imwrite(folder / fmt::format("{:02}.png", i), cv::Mat(48, 64, CV_8U, cv::Scalar(i)));
  constexpr std::size_t kFewest = 1;  // bytes: more pictures than one window follow
  Recording recording(folder / "", {.frame_rate_hz = 100.0, .to = fmt::format("f{}", kLast)},
                      kFewest);
  ASSERT_TRUE(recording.advance(0));
  const auto latest = [&] {
    double level = 0.0;
    for (const cv::Mat& luma : recording.samples().luma) level = std::max(level, cv::mean(luma)[0]);
    return level;
  };
  EXPECT_GT(latest(), kLast) << "a camera on a stand sees the same floor later";
  EXPECT_TRUE(recording.leave_out_the_rest());
  EXPECT_LE(latest(), kLast);
  EXPECT_GE(recording.samples().luma.size(), Background::kSamples);
  EXPECT_FALSE(recording.leave_out_the_rest()) << "it is left out";
  ASSERT_TRUE(recording.advance(0));
  EXPECT_LE(latest(), kLast);
}

}  // namespace
}  // namespace trochoid::tracking
