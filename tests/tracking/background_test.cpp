#include "find/background.hpp"

#include <gtest/gtest.h>

#include "drawn_clip.hpp"
#include "find/silhouette.hpp"

namespace trochoid::tracking {
namespace {

/// Frames of a dark disc at the given places over one floor.
std::vector<cv::Mat> frames_of(const cv::Mat& floor, const std::vector<cv::Point2d>& places) {
  std::mt19937 random(11);
  std::vector<cv::Mat> frames;
  for (const cv::Point2d& p : places) {
    cv::Mat picture = floor.clone();
    draw_disc(picture, p.x, p.y, 15.0, 15.0, 0.0, 40.0);
    frames.push_back(developed(picture, 2.0, random));
  }
  return frames;
}

double level_at(const cv::Mat& image, int x, int y) {
  return cv::mean(image(cv::Rect(x - 3, y - 3, 7, 7)))[0];
}

TEST(Background, ABodyThatRestsMostOfTheTimeIsNotFloor) {
  const cv::Mat floor = drawn_floor(200, 120, 150.0);
  std::vector<cv::Point2d> places(16, {150.0, 60.0});  // rests for 11 of 16 samples
  for (int i = 0; i < 5; ++i) places[static_cast<std::size_t>(i)] = {20.0 + 18.0 * i, 60.0};
  const auto frames = frames_of(floor, places);
  const Background background = Background::from_samples({frames, {}});
  EXPECT_NEAR(level_at(background.plate().luma, 150, 60), level_at(floor, 150, 60), 3.0);
  Frame last;
  last.luma = frames.back();
  const auto seen = find_silhouettes(last, background.plate());
  ASSERT_EQ(seen.size(), 1u);
  // A silhouette is for finding, not for measuring: a pixel or so.
  EXPECT_NEAR(seen[0].detection.centre_px.x(), 150.0, 1.5);
  EXPECT_NEAR(seen[0].detection.semi_major_px, 15.0, 1.5);
}

// Without its frames left out nothing of the picture is ever still, and the body stays in the
// floor.
TEST(Background, AHandThatReachesAcrossThePictureIsLeftOut) {
  const cv::Mat floor = drawn_floor(200, 120, 150.0);
  std::vector<cv::Point2d> places(16, {150.0, 60.0});  // rests for 11 of 16 samples
  for (int i = 0; i < 5; ++i) places[static_cast<std::size_t>(i)] = {20.0 + 18.0 * i, 60.0};
  std::vector<cv::Mat> frames = frames_of(floor, places);
  for (int i = 0; i < 6; ++i)
    frames[static_cast<std::size_t>(10 + i)](cv::Rect(0, 14 * i, 200, 50)) = 95;
  const Background background = Background::from_samples({frames, {}});
  EXPECT_NEAR(level_at(background.plate().luma, 150, 60), level_at(floor, 150, 60), 3.0);
  EXPECT_GT(background.active().at<std::uint8_t>(5, 5), 0) << "what the hand changed did change";
  EXPECT_FALSE(background.camera_moves());
}

// A clip that begins black, fades in or is cut from several; a third of the samples would pass for
// noise of as many levels as the floor has.
TEST(Background, PicturesWithoutLightAreLeftOut) {
  const cv::Mat floor = drawn_floor(200, 120, 150.0);
  std::vector<cv::Point2d> places;
  for (int i = 0; i < 10; ++i) places.emplace_back(20.0 + 16.0 * i, 60.0);
  std::vector<cv::Mat> frames = frames_of(floor, places);
  for (int i = 0; i < 6; ++i) frames.insert(frames.begin(), cv::Mat::zeros(floor.size(), CV_8U));
  const Background background = Background::from_samples({frames, {}});
  EXPECT_NEAR(background.plate().noise_levels, 2.0, 0.7);
  EXPECT_NEAR(level_at(background.plate().luma, 100, 60), level_at(floor, 100, 60), 3.0);
}

TEST(Background, ADarkFloorIsTheFloorThoughAFewPicturesAreWhite) {
  const cv::Mat floor = drawn_floor(200, 120, 9.0);
  std::mt19937 random(7);
  std::vector<cv::Mat> frames;
  for (int i = 0; i < 14; ++i) {
    cv::Mat picture = floor.clone();
    draw_disc(picture, 20.0 + 12.0 * i, 60.0, 15.0, 15.0, 0.0, 180.0);
    frames.push_back(developed(picture, 2.0, random));
  }
  for (int i = 0; i < 2; ++i) frames.emplace_back(floor.size(), CV_8U, cv::Scalar(250));
  const Background background = Background::from_samples({frames, {}});
  EXPECT_NEAR(level_at(background.plate().luma, 100, 20), level_at(floor, 100, 20), 3.0);
}

TEST(Background, NoiseIsMeasuredAndFlickerIsTakenOut) {
  std::mt19937 random(4);
  const cv::Mat floor = drawn_floor(160, 120, 120.0);
  std::vector<cv::Mat> frames;
  for (int i = 0; i < 16; ++i)
    frames.push_back(developed(floor * (1.0 + 0.1 * std::sin(i)), 3.0, random));
  const Background background = Background::from_samples({frames, {}});
  EXPECT_NEAR(background.plate().noise_levels, 3.0, 0.8);
  EXPECT_LT(cv::countNonZero(background.active()), 160 * 120 / 100);
  const double gain = background.gain(frames[3]) / background.gain(frames[0]);
  EXPECT_NEAR(gain, (1.0 + 0.1 * std::sin(3)), 0.01);
}

TEST(Background, ABodyThatNeverLeavesIsFilledIn) {
  const cv::Mat floor = drawn_floor(200, 160, 60.0);
  std::mt19937 random(9);
  std::vector<cv::Mat> frames;
  for (int i = 0; i < 16; ++i) {  // spins in place: its brightness never stays
    cv::Mat picture = floor.clone();
    draw_disc(picture, 100.0, 80.0, 25.0, 25.0, 0.0, 140.0 + 80.0 * std::sin(2.4 * i));
    frames.push_back(developed(picture, 2.0, random));
  }
  const Background background = Background::from_samples({frames, {}});
  EXPECT_NEAR(level_at(background.plate().luma, 100, 80), 60.0, 12.0);
}

// Its middle looks as still as a floor; the rim, which wobbles all round it, tells.
TEST(Background, TheMiddleOfAPlainBodyThatWobblesInPlaceIsFilledIn) {
  const cv::Mat floor = drawn_floor(200, 160, 150.0);
  std::mt19937 random(10);
  std::vector<cv::Mat> frames;
  for (int i = 0; i < 16; ++i) {
    cv::Mat picture = floor.clone();
    draw_disc(picture, 100.0, 80.0, 30.0, 20.0, 1.1 * i, 60.0);
    frames.push_back(developed(picture, 2.0, random));
  }
  const Background background = Background::from_samples({frames, {}});
  EXPECT_NEAR(level_at(background.plate().luma, 100, 80), 150.0, 12.0);
}

// Neither a small body on a wide way nor one that nearly touches it covers what lies in the middle.
TEST(Background, WhatABodyGoesRoundIsLeftAsItIs) {
  for (const double radius_px : {15.0, 32.0}) {
    cv::Mat floor = drawn_floor(240, 200, 150.0);
    draw_disc(floor, 120.0, 100.0, 9.0, 9.0, 0.0, 60.0);
    std::mt19937 random(12);
    std::vector<cv::Mat> frames;
    for (int i = 0; i < 16; ++i) {
      cv::Mat picture = floor.clone();
      draw_disc(picture, 120.0 + 48.0 * std::cos(0.4 * i), 100.0 + 48.0 * std::sin(0.4 * i),
                radius_px, radius_px, 0.0, 40.0);
      frames.push_back(developed(picture, 2.0, random));
    }
    const Background background = Background::from_samples({frames, {}});
    EXPECT_NEAR(level_at(background.plate().luma, 120, 100), 60.0, 6.0) << radius_px;
  }
}

}  // namespace
}  // namespace trochoid::tracking
