#include "find/camera_motion.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <functional>
#include <random>

#include "drawn_clip.hpp"

namespace trochoid::tracking {
namespace {

constexpr int kFloorWidth = 320, kFloorHeight = 240, kPictures = 40;
constexpr double kNoise_levels = 1.5;

const Eigen::Vector2d kMiddle_px(0.5 * (kFloorWidth - 1), 0.5 * (kFloorHeight - 1));

// A floor as it is drawn in drawn_floor(), some fraction of a pixel away, larger by growth about
// the middle and turned about it, lit by a lamp of its own.
cv::Mat floor_at(const Eigen::Vector2d& shift_px, double contrast, double lamp_levels,
                 std::complex<double> factor = 1.0) {
  cv::Mat floor(kFloorHeight, kFloorWidth, CV_64F);
  for (int y = 0; y < kFloorHeight; ++y)
    for (int x = 0; x < kFloorWidth; ++x) {
      const std::complex<double> from(x - shift_px.x() - kMiddle_px.x(),
                                      y - shift_px.y() - kMiddle_px.y());
      const double u = kMiddle_px.x() + (from / factor).real(),
                   v = kMiddle_px.y() + (from / factor).imag();
      floor.at<double>(y, x) =
          140.0 +
          contrast *
              (6.0 * std::sin(0.41 * u + 0.3) * std::sin(0.37 * v) +
               4.0 * std::sin(0.2 * (u + 2.0 * v)) + 3.0 * std::sin(0.31 * u - 0.17 * v + 1.0) +
               3.0 * std::sin(0.09 * u + 0.33 * v)) +
          lamp_levels *
              std::exp(-0.5 * (std::pow((x - 80) / 90.0, 2) + std::pow((y - 60) / 90.0, 2)));
    }
  return floor;
}

struct Scenery {
  std::function<Eigen::Vector2d(int frame)> shift_px;
  double contrast = 1.0;
  double lamp_levels = 0.0;  // by the last frame
  std::function<std::complex<double>(int frame)> factor = [](int) { return 1.0; };
};

// What is found of frames with a dark body that crosses them.
std::map<std::int64_t, PictureShift> found_in(const Scenery& scenery) {
  std::mt19937 random(5);
  const cv::Mat plate = developed(floor_at({0.0, 0.0}, scenery.contrast, 0.0), 0.3, random);
  CameraMotion motion(plate, kNoise_levels);
  for (int i = 0; i < kPictures; ++i) {
    cv::Mat picture = floor_at(scenery.shift_px(i), scenery.contrast,
                               scenery.lamp_levels * i / (kPictures - 1), scenery.factor(i));
    const Eigen::Vector2d at_px(60.0 + 5.0 * i, 120.0);
    draw_disc(picture, at_px.x(), at_px.y(), 20.0, 15.0, 0.3 * i, 40.0);
    Frame frame;
    frame.index = i;
    frame.luma = developed(picture, kNoise_levels, random);
    motion.look(frame, {{at_px, 20.0}});
  }
  return motion.shifts();
}

// A hundred points with a slope of 2 levels a pixel in each quarter, and noise of 1.5 levels: to
// 0.06 px, of which frames may be off three times.
TEST(CameraMotion, FollowsASaggingStandAndAKnockSinceTheBeginning) {
  const auto sags = [](int i) { return Eigen::Vector2d(0.04 * i, 0.02 * i); };
  const auto knocked = [](int i) {
    return i < 20 ? Eigen::Vector2d(0, 0) : Eigen::Vector2d(1.2, -0.8);
  };
  for (const std::function<Eigen::Vector2d(int)>& goes :
       {std::function<Eigen::Vector2d(int)>(sags), std::function<Eigen::Vector2d(int)>(knocked)}) {
    const auto shifts = found_in({goes});
    ASSERT_EQ(shifts.size(), static_cast<std::size_t>(kPictures));
    const Eigen::Vector2d first_px = goes(4) - 0.5 * (goes(4) - goes(3));  // the median of eight
    for (const auto& [index, shift] : shifts) {
      EXPECT_LT((shift.px - (goes(static_cast<int>(index)) - first_px)).norm(), 0.18) << index;
      EXPECT_LT(shift.sigma_px, 0.08);
    }
  }
}

// The median of a shake is off its middle by up to a quarter of it.
TEST(CameraMotion, ShakesAboutOnePlace) {
  const auto shakes = [](int i) { return Eigen::Vector2d(0.5 + 0.8 * std::sin(0.9 * i), 0.0); };
  const auto shifts = found_in({shakes});
  ASSERT_EQ(shifts.size(), static_cast<std::size_t>(kPictures));
  for (const auto& [index, shift] : shifts)
    EXPECT_LT((shift.px - shakes(static_cast<int>(index)) + Eigen::Vector2d(0.5, 0.0)).norm(), 0.3);
}

TEST(CameraMotion, OfACameraThatStandsStillIsNone) {
  const auto still = [](int) { return Eigen::Vector2d(0.0, 0.0); };
  EXPECT_TRUE(found_in({still}).empty());
  EXPECT_TRUE(found_in({still, 1.0, 60.0}).empty());  // a lamp comes up in a corner
}

// On a plain floor there is nothing to go by, whatever the camera does.
TEST(CameraMotion, IsNotMadeUpFromNoise) {
  const auto sags = [](int i) { return Eigen::Vector2d(0.04 * i, 0.0); };
  EXPECT_TRUE(found_in({sags, 0.0}).empty());
  EXPECT_TRUE(found_in({sags, 0.02}).empty());
}

// Of exactly upright stripes nothing is known along them.
TEST(CameraMotion, OnStripesIsNotGuessed) {
  cv::Mat plate(kFloorHeight, kFloorWidth, CV_8U);
  for (int x = 0; x < kFloorWidth; ++x)
    plate.col(x).setTo(cv::saturate_cast<std::uint8_t>(140.0 + 40.0 * std::sin(0.3 * x)));
  CameraMotion motion(plate, kNoise_levels);
  for (int i = 0; i < kPictures; ++i) {
    Frame frame;
    frame.index = i;
    frame.luma = plate.clone();
    motion.look(frame, {});
  }
  EXPECT_TRUE(motion.shifts().empty());
}

// A lens that breathes as it focuses, and one that zooms at once: places far from the middle go by
// more than a pixel, the middle by nothing.
TEST(CameraMotion, AFocusThatBreathesOrAZoomLetsThePictureGrow) {
  const auto still = [](int) { return Eigen::Vector2d(0.0, 0.0); };
  const auto breathes = [](int i) { return 0.0004 * i; };
  const auto zooms = [](int i) { return i < 20 ? 0.0 : 0.012; };
  const Eigen::Vector2d corner_px(30.0, 30.0), from_px = corner_px - kMiddle_px;
  for (const std::function<double(int)>& grows :
       {std::function<double(int)>(breathes), std::function<double(int)>(zooms)}) {
    const auto shifts = found_in({still, 1.0, 0.0, [&](int i) { return 1.0 + grows(i); }});
    ASSERT_EQ(shifts.size(), static_cast<std::size_t>(kPictures));
    const double first = grows(4) - 0.5 * (grows(4) - grows(3));
    for (const auto& [index, shift] : shifts) {
      const double growth = grows(static_cast<int>(index)) - first;
      EXPECT_LT(std::abs(shift.factor - (1.0 + growth)), 0.001) << index;
      EXPECT_LT(shift.px.norm(), 0.15) << index;
      const PictureShift there = shift.at(corner_px);
      EXPECT_LT((there.px - growth * from_px).norm(), 0.25) << index;
      EXPECT_GT(there.sigma_px, shift.sigma_px);
      EXPECT_LT(there.sigma_px, 0.15);
    }
  }
}

// A clamp that slips: 1.7 px in the corners.
TEST(CameraMotion, ACameraThatTurnsTurnsThePicture) {
  const auto still = [](int) { return Eigen::Vector2d(0.0, 0.0); };
  const auto turned_rad = [](int i) { return 0.0003 * i; };
  const auto shifts =
      found_in({still, 1.0, 0.0, [&](int i) { return std::polar(1.0, turned_rad(i)); }});
  ASSERT_EQ(shifts.size(), static_cast<std::size_t>(kPictures));
  const double first_rad = turned_rad(4) - 0.5 * (turned_rad(4) - turned_rad(3));
  for (const auto& [index, shift] : shifts) {
    const auto truth = std::polar(1.0, turned_rad(static_cast<int>(index)) - first_rad);
    EXPECT_LT(std::abs(shift.factor - truth), 0.001) << index;
    EXPECT_LT(shift.px.norm(), 0.15) << index;
    // Right on the screen: what lies to the right of the middle goes down.
    const PictureShift there = shift.at(kMiddle_px + Eigen::Vector2d(100.0, 0.0));
    EXPECT_NEAR(there.px.y(), 100.0 * truth.imag(), 0.2) << index;
  }
}

// By more than the pattern is wide, turning as well; and a stand that sags as far.
TEST(CameraMotion, FollowsAKnockByManyPixels) {
  const Eigen::Vector2d knock_px(17.0, -11.0);
  const auto knocked = [&](int i) { return Eigen::Vector2d((i < 20 ? 0.0 : 1.0) * knock_px); };
  const auto sags = [&](int i) { return Eigen::Vector2d(i / (kPictures - 1.0) * knock_px); };
  const auto turns = [](int i) { return std::polar(1.0, i < 20 ? 0.0 : 0.015); };
  for (const Scenery& scenery : {Scenery{.shift_px = knocked}, Scenery{.shift_px = sags},
                                 Scenery{.shift_px = knocked, .factor = turns}}) {
    const auto shifts = found_in(scenery);
    ASSERT_EQ(shifts.size(), static_cast<std::size_t>(kPictures));
    const Eigen::Vector2d first_px =
        0.5 * (scenery.shift_px(3) + scenery.shift_px(4));  // the median of eight
    for (const auto& [index, shift] : shifts) {
      const int i = static_cast<int>(index);
      EXPECT_LT((shift.px - (scenery.shift_px(i) - first_px)).norm(), 0.25) << index;
      EXPECT_LT(std::abs(shift.factor - scenery.factor(i)), 0.002) << index;
    }
  }
}

// A knock moves all of the picture, and it does not grow by that.
TEST(CameraMotion, DoesNotMakeAZoomOfAKnock) {
  const auto knocked = [](int i) { return Eigen::Vector2d(i < 20 ? 0.0 : 1.2, 0.0); };
  for (const auto& [index, shift] : found_in({knocked})) EXPECT_EQ(shift.factor, 1.0) << index;
}

// A push by more than can be followed: before it the camera shakes, and that is seen all the same.
TEST(CameraMotion, IsSeenBeforeAPushThatNoneCanFollow) {
  const auto pushed = [](int i) {
    return Eigen::Vector2d(0.8 * std::sin(0.9 * i) + (i < 30 ? 0.0 : 25.0), 0.0);
  };
  const auto shifts = found_in({pushed});
  ASSERT_GE(shifts.size(), 20U);
  for (const auto& [index, shift] : shifts) {
    if (index >= 30) continue;
    EXPECT_LT((shift.px - pushed(static_cast<int>(index))).norm(), 0.4) << index;
  }
}

}  // namespace
}  // namespace trochoid::tracking
