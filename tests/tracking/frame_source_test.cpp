#include "trochoid/tracking/frame_source.hpp"

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <unistd.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <string>
#include <vector>

#include "trochoid/data/error.hpp"

namespace trochoid::tracking {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr int kClipFrames = 12, kClipWidth = 64, kClipHeight = 48;

/// A folder of this test's own that vanishes with it.
class FrameSourceTest : public testing::Test {
 protected:
  FrameSourceTest()
      : folder_(fs::temp_directory_path() /
                ("trochoid_" +
                 std::string(testing::UnitTest::GetInstance()->current_test_info()->name()) +
                 std::to_string(::getpid()))) {
    fs::create_directories(folder_);
  }
  ~FrameSourceTest() override { fs::remove_all(folder_); }

  /// Gray level of frame i: distinct, and far enough apart to survive compression.
  static int level(int i) { return 20 + 15 * i; }

  fs::path write_clip(const std::string& name, const std::string& fourcc, double rate_hz) const {
    const fs::path path = folder_ / name;
    cv::VideoWriter writer(path.string(), cv::CAP_FFMPEG,
                           cv::VideoWriter::fourcc(fourcc[0], fourcc[1], fourcc[2], fourcc[3]),
                           rate_hz, cv::Size(kClipWidth, kClipHeight), true);
    EXPECT_TRUE(writer.isOpened());
    for (int i = 0; i < kClipFrames; ++i)
      writer.write(cv::Mat(kClipHeight, kClipWidth, CV_8UC3, cv::Scalar::all(level(i))));
    return path;
  }

  static std::string error_of(const fs::path& path, const SourceOptions& options = {}) {
    try {
      const auto source = open_video(path, options);
      while (source->next()) {
      }
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

  fs::path folder_;
};

TEST_F(FrameSourceTest, HandsOutEveryFrameWithItsOwnTime) {
  const auto source = open_video(write_clip("clip.mkv", "FFV1", 50.0));
  EXPECT_EQ(source->info().width_px, kClipWidth);
  EXPECT_EQ(source->info().height_px, kClipHeight);
  for (int i = 0; i < kClipFrames; ++i) {
    const auto frame = source->next();
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->index, i);
    EXPECT_NEAR(frame->t_s, 0.02 * i, 1e-3);  // Matroska counts milliseconds
    ASSERT_EQ(frame->luma.type(), CV_8UC1);
    // Full range: conversion to limited range and back rounds twice.
    EXPECT_NEAR(frame->luma.at<uchar>(5, 7), level(i), 2);
  }
  EXPECT_FALSE(source->next());
  EXPECT_FALSE(source->next()) << "the end stays the end";
}

/// Replaces the matrix in the header of an MP4's only track (ISO/IEC 14496-12, 8.3.2), whose
/// entries a, b, c, d map stored to displayed x and y.
void set_display_matrix(const fs::path& path, const std::array<int, 4>& abcd) {
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  const std::string bytes(std::istreambuf_iterator<char>(file), {});
  const size_t header = bytes.find("tkhd");
  ASSERT_NE(header, std::string::npos);
  const std::array<int, 4> place{0, 4, 12, 16};
  constexpr int kMatrix = 44;  // after the box's type, in its version 0
  for (size_t k = 0; k < place.size(); ++k) {
    const auto value = static_cast<std::uint32_t>(abcd[k]) << 16;  // big-endian 16.16
    file.seekp(static_cast<std::streamoff>(header) + kMatrix + place[k]);
    for (const int shift : {24, 16, 8, 0}) file.put(static_cast<char>(value >> shift));
  }
}

TEST_F(FrameSourceTest, APhoneHeldSidewaysGivesUprightPictures) {
  struct Case {
    std::array<int, 4> abcd;
    cv::Size size;
    cv::Point bright;  // where the stored top left corner is seen
    cv::Point low;     // and the stored bottom left one
  };
  const cv::Size lying(kClipWidth, kClipHeight), standing(kClipHeight, kClipWidth);
  const std::vector<Case> cases{
      {{1, 0, 0, 1}, lying, {5, 5}, {5, kClipHeight - 6}},
      // a quarter turn clockwise, upside down, and a quarter turn back
      {{0, 1, -1, 0}, standing, {kClipHeight - 6, 5}, {5, 5}},
      {{-1, 0, 0, -1}, lying, {kClipWidth - 6, kClipHeight - 6}, {kClipWidth - 6, 5}},
      {{0, -1, 1, 0}, standing, {5, kClipWidth - 6}, {kClipHeight - 6, kClipWidth - 6}}};
  for (const Case& c : cases) {
    const fs::path path = folder_ / "sideways.mp4";
    cv::Mat picture(kClipHeight, kClipWidth, CV_8UC3, cv::Scalar::all(40));
    picture(cv::Rect(0, 0, 16, 16)).setTo(cv::Scalar::all(220));
    {
      cv::VideoWriter writer(path.string(), cv::CAP_FFMPEG,
                             cv::VideoWriter::fourcc('m', 'p', '4', 'v'), 50.0, lying, true);
      ASSERT_TRUE(writer.isOpened());
      for (int i = 0; i < 3; ++i) writer.write(picture);
    }
    set_display_matrix(path, c.abcd);
    const auto source = open_video(path);
    EXPECT_EQ(source->info().width_px, c.size.width);
    EXPECT_EQ(source->info().height_px, c.size.height);
    const auto frame = source->next();
    ASSERT_TRUE(frame);
    ASSERT_EQ(frame->luma.size(), c.size);
    cv::Mat smooth;
    cv::blur(frame->luma, smooth, cv::Size(9, 9));
    EXPECT_GT(smooth.at<uchar>(c.bright), 180);
    EXPECT_LT(cv::mean(smooth)[0], 90.0);
    // A rolling shutter exposes the stored rows, one after the other.
    const auto share = [&](const cv::Point& at) {
      return readout_share(source->info(), Eigen::Vector2d(at.x, at.y));
    };
    EXPECT_NEAR(share(c.bright), 5.0 / (kClipHeight - 1), 1e-12);
    EXPECT_NEAR(share(c.low), 1.0 - 5.0 / (kClipHeight - 1), 1e-12);
  }
}

TEST_F(FrameSourceTest, TellsPixelsThatAreNotAsWideAsHigh) {
  const auto film = [&](const std::string& aspect) {
    const fs::path path = folder_ / "film.y4m";
    std::ofstream file(path, std::ios::binary);
    file << "YUV4MPEG2 W16 H16 F50:1 Ip A" << aspect << " C420jpeg\n";
    for (int i = 0; i < 3; ++i) file << "FRAME\n" << std::string(16 * 16 * 3 / 2, '\x80');
    file.close();
    return open_video(path)->info().pixel_aspect;
  };
  EXPECT_DOUBLE_EQ(film("4:3"), 4.0 / 3.0);
  EXPECT_DOUBLE_EQ(film("1:1"), 1.0);
  EXPECT_DOUBLE_EQ(film("0:0"), 1.0) << "unknown";
}

// Matroska counts milliseconds.
TEST_F(FrameSourceTest, PicturesOfOneTimeAreRefusedUnlessTheRateIsGiven) {
  const fs::path path = write_clip("fast.mkv", "FFV1", 2000.0);
  EXPECT_THAT(error_of(path), IsEmpty()) << "nobody minds";
  SourceOptions options;
  options.apart_in_time = true;
  EXPECT_THAT(error_of(path, options),
              HasSubstr("fast.mkv: frame 2 is shown at 0.001 s and the one before it at 0.001 s"));
  options.frame_rate_hz = 2000.0;
  EXPECT_THAT(error_of(path, options), IsEmpty());
}

TEST_F(FrameSourceTest, LimitedRangeLumaIsStretched) {
  for (const auto& [name, fourcc] :
       {std::pair{"clip.mp4", "avc1"}, std::pair{"clip.avi", "MJPG"}}) {
    const auto source = open_video(write_clip(name, fourcc, 25.0));
    const auto frame = source->next();
    ASSERT_TRUE(frame) << name;
    EXPECT_NEAR(cv::mean(frame->luma)[0], level(0), 3.0) << name;
  }
}

TEST_F(FrameSourceTest, ColourComesOnlyWhenAsked) {
  const fs::path clip = write_clip("clip.mp4", "mp4v", 25.0);
  EXPECT_TRUE(open_video(clip)->next()->bgr.empty());
  const auto frame = open_video(clip, {.colour = true})->next();
  ASSERT_EQ(frame->bgr.type(), CV_8UC3);
  EXPECT_NEAR(frame->bgr.at<cv::Vec3b>(3, 3)[2], level(0), 4);
}

TEST_F(FrameSourceTest, ARateGivenOverridesTheTimeStamps) {
  const auto source = open_video(write_clip("clip.mp4", "mp4v", 30.0), {.frame_rate_hz = 240.0});
  EXPECT_DOUBLE_EQ(source->info().frame_rate_hz, 240.0);
  ASSERT_TRUE(source->next());
  EXPECT_DOUBLE_EQ(source->next()->t_s, 1.0 / 240.0);
}

TEST_F(FrameSourceTest, AWindowKeepsIndexAndTimeOfTheWholeFile) {
  const fs::path clip = write_clip("clip.mp4", "mp4v", 10.0);
  const auto frames = open_video(clip, {.from = "f3", .to = "f5"});
  for (int i = 3; i <= 5; ++i) {
    const auto frame = frames->next();
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->index, i);
    EXPECT_NEAR(frame->t_s, 0.1 * i, 1e-6);
  }
  EXPECT_FALSE(frames->next());
  const auto seconds = open_video(clip, {.from = "0.5"});
  EXPECT_EQ(seconds->next()->index, 5);
  EXPECT_THAT(error_of(clip, {.from = "soon"}), HasSubstr("from = 'soon': give seconds"));
  for (const SourceOptions& reversed :
       {SourceOptions{.from = "0.5", .to = "0.1"}, SourceOptions{.from = "f5", .to = "f1"}})
    EXPECT_THAT(error_of(clip, reversed), HasSubstr("exchange them"));
}

TEST_F(FrameSourceTest, AWindowHoldsSomeOfTheRecordingOrIsRefused) {
  const fs::path clip = write_clip("clip.mp4", "mp4v", 10.0);
  EXPECT_THAT(error_of(clip, {.from = "-1"}), HasSubstr("from = -1 lies before the recording"));
  EXPECT_THAT(error_of(clip, {.to = "-0.1"}), HasSubstr("to = -0.1 lies before the recording"));
  EXPECT_THAT(error_of(clip, {.from = "99"}),
              HasSubstr(fmt::format("no picture lies from = 99: frame {}, at {:g} s, is the last",
                                    kClipFrames - 1, 0.1 * (kClipFrames - 1))));
  EXPECT_THAT(error_of(clip, {.from = "f5", .to = "0.2"}),
              HasSubstr("no picture lies from = f5 to = 0.2: frame 3, at 0.3 s, is past the end"));
}

TEST_F(FrameSourceTest, DecodingAheadChangesNothing) {
  const fs::path clip = write_clip("clip.mp4", "avc1", 25.0);
  const auto plain = open_video(clip);
  const auto ahead = decode_ahead(open_video(clip), 2);
  while (const auto a = plain->next()) {
    const auto b = ahead->next();
    ASSERT_TRUE(b);
    EXPECT_EQ(a->t_s, b->t_s);
    EXPECT_EQ(cv::norm(a->luma, b->luma, cv::NORM_INF), 0.0);
  }
  EXPECT_FALSE(ahead->next());
}

TEST_F(FrameSourceTest, DecodingAheadStopsWhenNobodyListens) {
  const auto ahead = decode_ahead(open_video(write_clip("clip.mp4", "avc1", 25.0)), 1);
  EXPECT_TRUE(ahead->next());
}

TEST_F(FrameSourceTest, ImagesAreASequenceOnceTheirRateIsKnown) {
  for (int i = 0; i < kClipFrames; ++i)
    cv::imwrite((folder_ / cv::format("img_%03d.png", 7 + i)).string(),
                cv::Mat(kClipHeight, kClipWidth, CV_16UC1, cv::Scalar(257.0 * level(i))));
  EXPECT_THAT(error_of(folder_ / "img_%03d.png"), HasSubstr("rate"));
  for (const fs::path& path : {folder_ / "img_%03d.png", folder_ / "img_*.png", folder_}) {
    const auto source = open_video(path, {.frame_rate_hz = 100.0});
    int count = 0;
    while (const auto frame = source->next()) {
      EXPECT_NEAR(frame->luma.at<uchar>(0, 0), level(count), 1) << path;
      EXPECT_DOUBLE_EQ(frame->t_s, count / 100.0);
      ++count;
    }
    EXPECT_EQ(count, kClipFrames) << path;
  }
  // sha256sum of the pictures' own sums, one to a line: the same however the series is named.
  const std::string digest = sha256_of_recording(folder_);
  EXPECT_EQ(digest.size(), 64U);
  EXPECT_EQ(sha256_of_recording(folder_ / "img_%03d.png"), digest);
  EXPECT_EQ(sha256_of_recording(folder_ / "img_*.png"), digest);
  fs::remove(folder_ / "img_018.png");
  EXPECT_NE(sha256_of_recording(folder_), digest);
}

TEST_F(FrameSourceTest, PicturesComeByTheirNumbersThoughTheseHaveNoLeadingZeros) {
  for (int i = 0; i < 12; ++i)
    cv::imwrite((folder_ / cv::format("a 50%% [1]_%d.png", 5 + i)).string(),
                cv::Mat(kClipHeight, kClipWidth, CV_8UC1, cv::Scalar(10.0 * i)));
  for (const char* series : {"", "a*_*.png"}) {
    const auto source = open_video(folder_ / series, {.frame_rate_hz = 10.0});
    for (int i = 0; i < 12; ++i) {
      const auto frame = source->next();
      ASSERT_TRUE(frame) << series << i;
      EXPECT_EQ(frame->index, i);
      EXPECT_EQ(frame->luma.at<uchar>(0, 0), 10 * i) << series;
    }
    EXPECT_FALSE(source->next());
    EXPECT_EQ(source->info().missing, 0);
  }
}

TEST_F(FrameSourceTest, APatternMeansTheImagesThatItMatches) {
  std::ofstream(folder_ / "notes.txt") << "of the day";
  EXPECT_THAT(error_of(folder_ / "n*"), HasSubstr("no images have such names"));
  cv::imwrite((folder_ / "n1.png").string(),
              cv::Mat(kClipHeight, kClipWidth, CV_8UC1, cv::Scalar(10.0)));
  EXPECT_EQ(open_video(folder_ / "n*", {.frame_rate_hz = 10.0})->info().frames, 1);
}

TEST_F(FrameSourceTest, AMissingPictureShiftsNoOthersInTime) {
  for (const int number : {98, 99, 100, 103, 104})
    for (const char* name : {"padded_%04d.png", "plain_%d.png"})
      cv::imwrite((folder_ / cv::format(name, number)).string(),
                  cv::Mat(kClipHeight, kClipWidth, CV_8UC1, cv::Scalar(number)));
  for (const char* series :
       {"padded_%04d.png", "padded_*.png", "plain_%d.png", "plain_*.png", "plain_[0-9]*.png"}) {
    const auto source = open_video(folder_ / series, {.frame_rate_hz = 10.0});
    EXPECT_EQ(source->info().frames, 5) << series;
    EXPECT_EQ(source->info().missing, 2) << series;
    for (const int number : {98, 99, 100, 103, 104}) {
      const auto frame = source->next();
      ASSERT_TRUE(frame) << series << number;
      EXPECT_EQ(frame->luma.at<uchar>(0, 0), number) << series;
      EXPECT_EQ(frame->index, number - 98) << series;
      EXPECT_DOUBLE_EQ(frame->t_s, (number - 98) / 10.0) << series;
    }
    EXPECT_FALSE(source->next());
  }
}

TEST_F(FrameSourceTest, NumbersThatCountNoFramesOnlyOrderPictures) {
  const auto frames_of = [&](const std::vector<const char*>& names) {
    const fs::path folder = folder_ / names.front();
    fs::create_directory(folder);
    for (const char* name : names)
      cv::imwrite((folder / name).string(),
                  cv::Mat(kClipHeight, kClipWidth, CV_8UC1, cv::Scalar(9)));
    const auto source = open_video(folder, {.frame_rate_hz = 10.0});
    std::vector<std::int64_t> found;
    while (const auto frame = source->next()) found.push_back(frame->index);
    return found;
  };
  const std::vector<std::int64_t> one_by_one{0, 1, 2, 3};
  // Every tenth kept; times of day in milliseconds; no number alone.
  EXPECT_EQ(frames_of({"a_0010.png", "a_0020.png", "a_0030.png", "a_0040.png"}), one_by_one);
  EXPECT_EQ(frames_of({"t101502033.png", "t101502066.png", "t101502101.png", "t101502133.png"}),
            one_by_one);
  EXPECT_EQ(frames_of({"1015_1.png", "1015_2.png", "1016_1.png", "1016_9.png"}), one_by_one);
  EXPECT_EQ(frames_of({"1_9.png", "cover.png", "._1_9.png"}), (std::vector<std::int64_t>{0, 1}));
  EXPECT_EQ(frames_of({"only.png"}), (std::vector<std::int64_t>{0}));
}

TEST_F(FrameSourceTest, APictureNamedUnlikeTheNumberedOnesOfItsFolderIsNoFrame) {
  for (const char* name : {"p1.png", "p2.PNG", "p4.png", "empty floor.png", "z.png"})
    cv::imwrite((folder_ / name).string(),
                cv::Mat(kClipHeight, kClipWidth, CV_8UC1, cv::Scalar(9)));
  const auto source = open_video(folder_, {.frame_rate_hz = 10.0});
  EXPECT_EQ(source->info().frames, 3);
  EXPECT_EQ(source->info().missing, 1);
  EXPECT_THAT(source->info().left_out, ElementsAre(folder_ / "empty floor.png", folder_ / "z.png"));
  EXPECT_THAT(open_video(folder_ / "*.png", {.frame_rate_hz = 10.0})->info().left_out, IsEmpty());
}

TEST_F(FrameSourceTest, APictureThatMayFillAGapOfItsSeriesStays) {
  const cv::Mat picture(kClipHeight, kClipWidth, CV_8UC1, cv::Scalar(9));
  for (const char* name : {"b_0001.png", "b_0002.png", "b_0003_COVER.png", "b_0004.png"})
    cv::imwrite((folder_ / name).string(), picture);
  EXPECT_EQ(open_video(folder_, {.frame_rate_hz = 10.0})->info().frames, 4);
  cv::imwrite((folder_ / "b_0003.png").string(), picture);
  const auto whole = open_video(folder_, {.frame_rate_hz = 10.0});
  EXPECT_THAT(whole->info().left_out, ElementsAre(folder_ / "b_0003_COVER.png"));
  EXPECT_EQ(whole->info().missing, 0);
}

TEST_F(FrameSourceTest, ASeriesCountsByItsOwnNumberAndFoldersFollowEachOther) {
  const cv::Mat picture(kClipHeight, kClipWidth, CV_8UC1, cv::Scalar(9));
  for (int i = 1; i < 13; ++i)
    cv::imwrite((folder_ / cv::format("cam1%d.png", i)).string(), picture);
  const auto series = open_video(folder_ / "cam1%d.png", {.frame_rate_hz = 10.0});
  EXPECT_EQ(series->info().missing, 0);
  for (const auto& [name, level] : {std::pair{"100C/p9.png", 10}, {"101C/p1.png", 20}}) {
    fs::create_directory((folder_ / name).parent_path());
    cv::imwrite((folder_ / name).string(),
                cv::Mat(kClipHeight, kClipWidth, CV_8UC1, cv::Scalar(level)));
  }
  const auto folders = open_video(folder_ / "*C" / "p*.png", {.frame_rate_hz = 10.0});
  for (const int level : {10, 20}) EXPECT_EQ(folders->next().value().luma.at<uchar>(0, 0), level);
}

TEST_F(FrameSourceTest, TwoPicturesOfOneNumberHaveNoOrder) {
  for (const char* name : {"1.png", "01.png", "2.png"})
    cv::imwrite((folder_ / name).string(),
                cv::Mat(kClipHeight, kClipWidth, CV_8UC1, cv::Scalar(9)));
  EXPECT_THAT(error_of(folder_, {.frame_rate_hz = 10.0}),
              HasSubstr("01.png has the same number as"));
}

// A photograph as a camera stores it that was held so, by Exif 2.32, 4.6.4: which side of what is
// seen is row 0 and which is column 0.
void photograph(const cv::Mat& upright, int orientation, const fs::path& path) {
  cv::Mat stored = upright.clone();
  if (orientation >= 5) cv::transpose(upright, stored);
  constexpr int kAsIs = 2, kFlips[] = {kAsIs, 1, -1, 0, kAsIs, 0, -1, 1};
  if (const int flip = kFlips[orientation - 1]; flip != kAsIs) cv::flip(stored, stored, flip);
  std::vector<uchar> jpeg;
  cv::imencode(".jpg", stored, jpeg);
  const auto value = static_cast<uchar>(orientation);
  const std::vector<uchar> exif{0xff, 0xe1, 0, 34, 'E', 'x',   'i', 'f', 0, 0,    'M', 'M',
                                0,    42,   0, 0,  0,   8,     0,   1,   1, 0x12, 0,   3,
                                0,    0,    0, 1,  0,   value, 0,   0,   0, 0,    0,   0};
  jpeg.insert(jpeg.begin() + 2, exif.begin(), exif.end());
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(jpeg.data()), static_cast<std::streamsize>(jpeg.size()));
}

// No two of the eight ways to hold it look alike.
cv::Mat marked_picture() {
  cv::Mat picture(kClipHeight, kClipWidth, CV_8UC1, cv::Scalar(40));
  picture(cv::Rect(0, 0, 16, 16)) = 220;
  picture(cv::Rect(kClipWidth - 16, 0, 16, 16)) = 130;
  return picture;
}

void expect_upright(const Frame& frame) {
  ASSERT_EQ(frame.luma.size(), cv::Size(kClipWidth, kClipHeight));
  EXPECT_NEAR(frame.luma.at<uchar>(4, 4), 220, 6);
  EXPECT_NEAR(frame.luma.at<uchar>(4, kClipWidth - 4), 130, 6);
  EXPECT_NEAR(frame.luma.at<uchar>(kClipHeight - 4, 4), 40, 6);
}

TEST_F(FrameSourceTest, PhotographsComeUprightHoweverTheCameraWasHeld) {
  for (int orientation = 1; orientation <= 8; ++orientation) {
    SCOPED_TRACE(orientation);
    photograph(marked_picture(), orientation, folder_ / "held.jpg");
    const auto source = open_video(folder_ / "held.jpg");
    EXPECT_EQ(source->info().width_px, kClipWidth);
    EXPECT_EQ(source->info().height_px, kClipHeight);
    const auto frame = source->next();
    ASSERT_TRUE(frame);
    expect_upright(*frame);
    EXPECT_FALSE(source->next());
  }
}

TEST_F(FrameSourceTest, APhotographUnlikeTheFirstOfItsSeriesIsRefused) {
  const SourceOptions rate{.frame_rate_hz = 10.0};
  const fs::path series = folder_ / "p*.jpg";
  for (int i = 0; i < 4; ++i) photograph(marked_picture(), 6, folder_ / cv::format("p%d.jpg", i));
  const auto source = open_video(series, rate);
  EXPECT_EQ(source->info().orientation, 6);
  int count = 0;
  for (; const auto frame = source->next(); ++count) {
    SCOPED_TRACE(count);
    expect_upright(*frame);
  }
  EXPECT_EQ(count, 4);

  photograph(marked_picture(), 3, folder_ / "p2.jpg");
  EXPECT_THAT(error_of(series, rate),
              HasSubstr("frame 2 (p2.jpg): the camera was held another way"));
  // Of as many pixels, but higher than wide.
  cv::Mat portrait;
  cv::transpose(marked_picture(), portrait);
  photograph(portrait, 6, folder_ / "p2.jpg");
  EXPECT_THAT(
      error_of(series, rate),
      HasSubstr(cv::format("frame 2 (p2.jpg): the picture size changes from %d x %d to %d x %d",
                           kClipWidth, kClipHeight, kClipHeight, kClipWidth)));
}

TEST_F(FrameSourceTest, APictureOfASeriesThatCannotBeDecodedIsNotPassedOver) {
  const SourceOptions rate{.frame_rate_hz = 10.0};
  for (int i = 0; i < 6; ++i) photograph(marked_picture(), 1, folder_ / cv::format("p%d.jpg", i));
  for (const char* series : {"p*.jpg", "p%d.jpg"})
    for (const char* words : {"these are words, not a picture", ""}) {
      std::ofstream(folder_ / "p0.jpg") << words;
      EXPECT_THAT(error_of(folder_ / series, rate),
                  HasSubstr("picture 1 of 6, p0.jpg, cannot be decoded"))
          << series << words;
      photograph(marked_picture(), 1, folder_ / "p0.jpg");
      std::ofstream(folder_ / "p3.jpg") << words;
      EXPECT_THAT(error_of(folder_ / series, rate),
                  HasSubstr("picture 4 of 6, p3.jpg, cannot be decoded"))
          << series << words;
      std::ofstream(folder_ / "p5.jpg") << words;
      photograph(marked_picture(), 1, folder_ / "p3.jpg");
      EXPECT_THAT(error_of(folder_ / series, rate),
                  HasSubstr("picture 6 of 6, p5.jpg, cannot be decoded"))
          << series << words;
      photograph(marked_picture(), 1, folder_ / "p5.jpg");
    }
  EXPECT_EQ(error_of(folder_ / "p*.jpg", rate), "");
}

/// Wipes the header of one JPEG picture in a file of many.
void wipe_picture(const fs::path& path, int which) {
  constexpr int kHeader_bytes = 200;  // of some 230 in all
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  const std::string bytes(std::istreambuf_iterator<char>(file), {});
  size_t at = bytes.find("\xff\xd8\xff");
  for (int i = 0; i < which && at != std::string::npos; ++i)
    at = bytes.find("\xff\xd8\xff", at + 1);
  ASSERT_NE(at, std::string::npos);
  file.seekp(static_cast<std::streamoff>(at));
  file.write(std::string(kHeader_bytes, '\0').c_str(), kHeader_bytes);
}

TEST_F(FrameSourceTest, APictureLostInsideAVideoShiftsNoOthersInTime) {
  constexpr int kLost = 5;
  for (const char* name : {"clip.mkv", "clip.avi"}) {
    const fs::path path = write_clip(name, "MJPG", 50.0);
    wipe_picture(path, kLost);
    for (const double rate_hz : {50.0, 500.0}) {
      SourceOptions options;
      if (rate_hz != 50.0) options.frame_rate_hz = rate_hz;
      const auto source = open_video(path, options);
      for (int i = 0; i < kClipFrames; ++i) {
        if (i == kLost) continue;
        const auto frame = source->next();
        ASSERT_TRUE(frame);
        EXPECT_EQ(frame->index, i - (i > kLost ? 1 : 0));
        EXPECT_NEAR(frame->t_s, i / rate_hz, 1e-4) << name;
        EXPECT_EQ(frame->missing_before, i == kLost + 1 ? 1 : 0) << name << ", picture " << i;
      }
      EXPECT_FALSE(source->next());
    }
  }
}

// Two before picture 3 and one before picture 7: by the rate of the file, or the one that is given.
TEST_F(FrameSourceTest, PicturesKnownToBeMissingMakeTheOthersLater) {
  const fs::path path = write_clip("clip.mkv", "MJPG", 50.0);
  for (const double rate_hz : {50.0, 500.0}) {
    SourceOptions options{.missing_frames = {7, 3, 3}};
    if (rate_hz != 50.0) options.frame_rate_hz = rate_hz;
    const auto source = open_video(path, options);
    for (int i = 0; i < kClipFrames; ++i) {
      const auto frame = source->next();
      ASSERT_TRUE(frame);
      EXPECT_EQ(frame->index, i);
      EXPECT_NEAR(frame->t_s, (i + (i >= 3 ? 2 : 0) + (i >= 7 ? 1 : 0)) / rate_hz, 1e-4);
    }
  }
  // A window is one of the times that are right.
  const auto source = open_video(path, {.missing_frames = {3, 3}, .from = "0.09"});
  EXPECT_EQ(source->next()->index, 3);
}

TEST_F(FrameSourceTest, APictureNamedLikeASeriesIsAPictureWhereItExists) {
  cv::imwrite((folder_ / "half.png").string(),
              cv::Mat(kClipHeight, kClipWidth, CV_8UC1, cv::Scalar(90)));
  fs::rename(folder_ / "half.png", folder_ / "50%d.png");
  const auto source = open_video(folder_ / "50%d.png");
  const auto frame = source->next();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->luma.at<uchar>(3, 3), 90);
}

TEST_F(FrameSourceTest, BadFilesAreRefusedInOneLineThatNamesThem) {
  const fs::path empty = folder_ / "empty.mp4", words = folder_ / "words.mp4";
  std::ofstream(empty).close();
  std::ofstream(words) << "these are words, not pictures, and they go on for a while";
  EXPECT_THAT(error_of(folder_ / "missing.mp4"), HasSubstr("missing.mp4: no such file"));
  EXPECT_THAT(error_of(empty), HasSubstr("empty.mp4: the file is empty"));
  EXPECT_THAT(error_of(words), HasSubstr("words.mp4: not a readable video"));
  EXPECT_THAT(error_of(folder_ / "sub" / "%04d.png", {.frame_rate_hz = 1.0}),
              HasSubstr("no such folder"));
  EXPECT_EQ(error_of(empty).find('\n'), std::string::npos);
}

TEST_F(FrameSourceTest, AFileCutShortIsNotTakenForAWholeOne) {
  // The index is in front and promises 250 frames; two thirds of the pictures follow.
  const fs::path whole = fs::path(TROCHOID_SOURCE_DIR) / "data/samples/s1_disc_paper/video.mp4";
  std::ifstream in(whole, std::ios::binary);
  std::string bytes((std::istreambuf_iterator<char>(in)), {});
  const bool index_in_front = bytes.find("moov") < bytes.find("mdat");
  const fs::path cut = folder_ / "cut.mp4";
  std::ofstream(cut, std::ios::binary) << bytes.substr(0, bytes.size() * 2 / 3);
  EXPECT_THAT(error_of(cut),
              HasSubstr(index_in_front ? "breaks off after frame" : "not a readable video"));
  // Matroska says how long it lasts, whatever rate its pictures were taken at.
  std::ifstream clip(write_clip("clip.mkv", "FFV1", 50.0), std::ios::binary);
  bytes.assign((std::istreambuf_iterator<char>(clip)), {});
  const fs::path half = folder_ / "half.mkv";
  std::ofstream(half, std::ios::binary) << bytes.substr(0, bytes.size() / 2);
  EXPECT_THAT(error_of(half), HasSubstr("breaks off at"));
  EXPECT_THAT(error_of(half, {.frame_rate_hz = 500.0}), HasSubstr("breaks off at"));
}

}  // namespace
}  // namespace trochoid::tracking
