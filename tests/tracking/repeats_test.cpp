#include "find/repeats.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

namespace trochoid::tracking {
namespace {

// A disc on noise of the camera; its place in pixels.
cv::Mat picture(double x_px, int seed) {
  cv::Mat luma(120, 160, CV_8UC1);
  cv::RNG random(static_cast<std::uint64_t>(seed) + 1);
  random.fill(luma, cv::RNG::NORMAL, 180.0, 2.0);
  constexpr int kBits = 4;  // of the fraction of a pixel
  cv::circle(luma, cv::Point2d(x_px * (1 << kBits), 60 << kBits), 20 << kBits, cv::Scalar(60),
             cv::FILLED, cv::LINE_AA, kBits);
  return luma;
}

// Of pictures of the disc at these places, the same where it has not moved.
std::int64_t repeats_of(const std::vector<double>& places_px) {
  Repeats repeats;
  for (std::size_t i = 0, seed = 0; i < places_px.size(); ++i) {
    if (i == 0 || places_px[i] != places_px[i - 1]) seed = i;
    repeats.add(picture(places_px[i], static_cast<int>(seed)));
  }
  return repeats.count();
}

TEST(Repeats, PicturesThatComeTwiceWhileTheBodyMovesAreCounted) {
  EXPECT_EQ(repeats_of({30, 33, 36, 39, 42}), 0);
  EXPECT_EQ(repeats_of({30, 30, 33, 33, 36, 36, 39, 39}), 3);  // of the last nothing is known
  EXPECT_EQ(repeats_of({30, 33, 36, 36, 36, 39, 42}), 2);
}

// Coded anew, or converted by a program that adds noise, a repeated picture is not the same to the
// last level.
TEST(Repeats, PicturesThatComeTwiceButForNoiseAreCounted) {
  Repeats repeats;
  const std::vector<double> places_px{30, 33, 36, 36, 39, 42, 42, 45};
  for (std::size_t i = 0; i < places_px.size(); ++i) {
    cv::Mat luma = picture(places_px[i], static_cast<int>(i));
    // The codec's blocks come and go.
    luma(cv::Rect(8 * static_cast<int>(i), 8, 8, 8)) += 3.0;
    repeats.add(luma);
  }
  EXPECT_EQ(repeats.count(), 2);
}

TEST(Repeats, ABodyAtRestRepeatsNothing) {
  EXPECT_EQ(repeats_of(std::vector<double>(30, 40.0)), 0);
  EXPECT_EQ(repeats_of({30, 33, 36, 36, 36, 36, 36, 36}), 0);  // comes to rest
  std::vector<double> rests_between{30, 33, 36};
  rests_between.insert(rests_between.end(), 20, 36.0);
  rests_between.insert(rests_between.end(), {39, 42, 45});
  EXPECT_EQ(repeats_of(rests_between), 0);
  EXPECT_EQ(repeats_of({30, 33, 36, 36, 33, 30, 27}), 0);                  // turns back
  EXPECT_EQ(repeats_of({30, 31.5, 32.4, 32.7, 32.7, 32.4, 31.5, 30}), 0);  // turns round slowly
}

}  // namespace
}  // namespace trochoid::tracking
