#include "find/palette.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>

namespace trochoid::tracking {
namespace {

/// A face of about one colour, each point a few levels off.
FaceColours face_of(int luma, int u, int v, std::mt19937& random, int scatter = 4) {
  std::uniform_int_distribution<int> off(-scatter, scatter);
  FaceColours face;
  for (face.count = 0; face.count < FaceColours::kMost; ++face.count)
    for (std::size_t plane = 0; plane < 3; ++plane)
      face.at[static_cast<std::size_t>(face.count)][plane] = static_cast<std::uint8_t>(
          std::clamp(std::array{luma, u, v}[plane] + off(random), 0, 255));
  return face;
}

// The hand differs in luma, in colour alone, or not at all.
TEST(Palette, KnowsTheBodyAndTellsItFromAHand) {
  std::mt19937 random(3);
  Palette palette;
  for (int i = 0; i < 20; ++i) palette.learn(face_of(60, 128, 128, random), 1.0);
  EXPECT_TRUE(palette.fits(face_of(62, 127, 129, random), 1.0));
  EXPECT_FALSE(palette.fits(face_of(160, 128, 128, random), 1.0));
  EXPECT_FALSE(palette.fits(face_of(60, 110, 150, random), 1.0));
}

TEST(Palette, AllowsForTheBrightnessOfTheFrame) {
  std::mt19937 random(3);
  Palette palette;
  for (int i = 0; i < 20; ++i) palette.learn(face_of(100, 120, 140, random), 1.0);
  EXPECT_TRUE(palette.fits(face_of(70, 120, 140, random), 0.7));
  EXPECT_FALSE(palette.fits(face_of(70, 120, 140, random), 1.0));
}

TEST(Palette, OfAFaceHalfHiddenTheRestIsEnough) {
  std::mt19937 random(3);
  Palette palette;
  for (int i = 0; i < 20; ++i) palette.learn(face_of(60, 128, 128, random), 1.0);
  FaceColours half = face_of(60, 128, 128, random);
  const FaceColours hand = face_of(160, 110, 150, random);
  for (std::size_t i = 0; i < FaceColours::kMost / 2; ++i) half.at[i] = hand.at[i];
  EXPECT_NEAR(palette.share(half, 1.0), 0.5, 0.05);
  EXPECT_TRUE(palette.fits(half, 1.0));
}

// Of a body that flashes nothing is known but that it flashes.
TEST(Palette, WhatChangesAllTheTimeTellsNothing) {
  std::mt19937 random(3);
  std::uniform_int_distribution<int> luma(20, 235);
  Palette palette;
  for (int i = 0; i < 60; ++i) palette.learn(face_of(luma(random), 128, 128, random, 1), 1.0);
  int refused = 0;
  for (int i = 0; i < 60; ++i)
    refused += palette.fits(face_of(luma(random), 128, 128, random, 1), 1.0) ? 0 : 1;
  EXPECT_EQ(refused, 0);
}

TEST(Palette, KnowsNothingBeforeItHasLearntAnything) {
  std::mt19937 random(3);
  EXPECT_TRUE(Palette().fits(face_of(60, 128, 128, random), 1.0));
  EXPECT_FALSE(Palette().shows({60, 128, 128}, 1.0));
}

}  // namespace
}  // namespace trochoid::tracking
