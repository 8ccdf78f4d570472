#include "trochoid/tracking/inspect.hpp"

#include <gtest/gtest.h>

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <string>

namespace trochoid::tracking {
namespace {

namespace fs = std::filesystem;

constexpr int kInspectedFrames = 60, kInspectedWidth = 240, kInspectedHeight = 200;
constexpr double kRadius_px = 40.0;

/// A filmed body on a floor whose brightness changes across the picture, with camera noise.
class InspectTest : public testing::Test {
 protected:
  ~InspectTest() override { fs::remove(path_); }

  Inspection inspected(const std::function<void(int frame, cv::Mat& picture)>& draw) const {
    cv::VideoWriter writer(path_.string(), cv::CAP_FFMPEG,
                           cv::VideoWriter::fourcc('F', 'F', 'V', '1'), 60.0,
                           cv::Size(kInspectedWidth, kInspectedHeight), true);
    EXPECT_TRUE(writer.isOpened());
    cv::RNG noise(7);
    for (int i = 0; i < kInspectedFrames; ++i) {
      cv::Mat picture(kInspectedHeight, kInspectedWidth, CV_8UC3);
      for (int x = 0; x < kInspectedWidth; ++x)
        picture.col(x).setTo(cv::Scalar::all(150.0 + 0.15 * x));
      draw(i, picture);
      cv::GaussianBlur(picture, picture, cv::Size(), 0.7);
      cv::Mat grain(picture.size(), CV_16SC3), sum;
      noise.fill(grain, cv::RNG::NORMAL, 0.0, 1.0);
      cv::add(picture, grain, sum, cv::noArray(), CV_8UC3);
      writer.write(sum);
    }
    writer.release();
    return inspect_video(path_);
  }

  fs::path path_ = fs::temp_directory_path() /
                   ("trochoid_inspect_" +
                    std::string(testing::UnitTest::GetInstance()->current_test_info()->name()) +
                    std::to_string(::getpid()) + ".mkv");
};

/// A body tilted by about 45 degrees towards a direction that turns.
cv::RotatedRect tilted(int frame, const cv::Point2f& centre, double radius_px) {
  const auto size = static_cast<float>(2.0 * radius_px);
  return {centre, cv::Size2f(size, 0.7f * size), static_cast<float>(13.0 * frame)};
}

TEST_F(InspectTest, TheFloorSeenThroughTheMiddleMakesARing) {
  const Inspection seen = inspected([](int i, cv::Mat& picture) {
    const cv::Point2f centre(60.0f + 2.0f * static_cast<float>(i), 100.0f);
    cv::Mat floor = picture.clone();
    cv::ellipse(picture, tilted(i, centre, kRadius_px), cv::Scalar::all(50), cv::FILLED,
                cv::LINE_AA);
    cv::Mat bore(picture.size(), CV_8UC1, cv::Scalar(0));
    cv::ellipse(bore, tilted(i, centre, 0.7 * kRadius_px), cv::Scalar(255), cv::FILLED);
    floor.copyTo(picture, bore);
  });
  ASSERT_TRUE(seen.body);
  EXPECT_TRUE(seen.body->bore_shows);
  EXPECT_NEAR(seen.body->radius_px, kRadius_px, 2.0);
}

TEST_F(InspectTest, ADiscThatTurnsInPlaceHidesItsFloorAndIsNoRing) {
  const Inspection seen = inspected([](int i, cv::Mat& picture) {
    const auto turn = static_cast<float>(13.0 * i * CV_PI / 180.0);
    const cv::Point2f centre(120.0f + 6.0f * std::cos(turn), 100.0f + 6.0f * std::sin(turn));
    // The face mirrors more light now and then.
    const double face = 60.0 + (i % 7 == 0 ? 60.0 : 0.0);
    cv::ellipse(picture, tilted(i, centre, kRadius_px), cv::Scalar::all(face), cv::FILLED,
                cv::LINE_AA);
  });
  ASSERT_TRUE(seen.body);
  EXPECT_FALSE(seen.body->bore_shows);
  EXPECT_NEAR(seen.body->radius_px, kRadius_px, 2.0);
}

TEST_F(InspectTest, ADiscAsDarkAsTheDarkFieldsOfItsFloorIsNoRing) {
  const Inspection seen = inspected([](int i, cv::Mat& picture) {
    constexpr int kField_px = 40;
    const cv::Scalar dark = cv::Scalar::all(95.0);
    for (int x = 0; x < kInspectedWidth; x += kField_px)
      for (int y = 0; y < kInspectedHeight; y += kField_px)
        if ((x + y) / kField_px % 2 == 0)
          cv::rectangle(picture, cv::Rect(x, y, kField_px, kField_px), dark, cv::FILLED);
    // From one dark field to the next across their common corner, slowly where all is dark.
    const double along = 2.0 * i / kInspectedFrames,
                 eased = along - std::sin(2.0 * CV_PI * along) / (2.0 * CV_PI);
    const auto at = static_cast<float>(60.0 + kField_px * eased);
    const cv::Point2f centre(at, at);
    cv::ellipse(picture, tilted(i, centre, kRadius_px), dark, cv::FILLED, cv::LINE_AA);
  });
  ASSERT_TRUE(seen.body);
  EXPECT_FALSE(seen.body->bore_shows);
}

}  // namespace
}  // namespace trochoid::tracking
