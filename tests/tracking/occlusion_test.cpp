#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <opencv2/videoio.hpp>
#include <random>

#include "drawn_clip.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/tracking/tracker.hpp"

namespace trochoid::tracking {
namespace {

namespace fs = std::filesystem;

const fs::path kSample = fs::path(TROCHOID_SOURCE_DIR) / "data/samples/s1_disc_paper";
constexpr int kFirst = 60, kFilmed = 90, kCovers = 100;  // of the sample

/// An arm from the left whose tip reaches over the disc in frame kCovers and withdraws slowly, the
/// disc long since elsewhere.
void draw_arm(cv::Mat& picture, int frame, const Eigen::Vector2d& disc_px, double level) {
  constexpr double kHalf_px = 22.0, kReach_px = 88.0, kSlope = 0.15, kTakes = 28.0;
  const double s = (frame - kCovers) / kTakes;
  const double tip = disc_px.x() - 20.0 + kReach_px * (1.0 - std::abs(s));
  const double middle = disc_px.y() + 20.0 * std::sin(3.0 * s);
  if (std::abs(s) > 1.6) return;
  for (int y = 0; y < picture.rows; ++y)
    for (int x = 0; x < picture.cols; ++x) {
      const bool arm = x < tip && std::abs(y - middle - kSlope * (x - tip)) < kHalf_px;
      if (arm || std::hypot(x - tip, y - middle) < kHalf_px) picture.at<double>(y, x) = level;
    }
}

/// Where the disc is, by frame of the sample, in pixels.
std::map<int, Eigen::Vector2d> true_centres() {
  const data::Table truth = data::read_table(kSample / "truth.csv");
  const Eigen::VectorXd frame = truth.column("frame"), x = truth.column("x_px"),
                        y = truth.column("y_px");
  std::map<int, Eigen::Vector2d> centres;
  for (Eigen::Index i = 0; i < frame.size(); ++i)
    centres[static_cast<int>(std::lround(frame[i]))] = {x[i], y[i]};
  return centres;
}

/// Part of the sample, in levels of grey, with the arm in the way.
void write_with_arm(const fs::path& clip, const Eigen::Vector2d& disc_px, double level) {
  cv::VideoCapture sample((kSample / "video.mp4").string(), cv::CAP_FFMPEG);
  cv::VideoWriter writer(clip.string(), cv::CAP_FFMPEG, cv::VideoWriter::fourcc('F', 'F', 'V', '1'),
                         100.0, {640, 480}, false);
  std::mt19937 random(5);
  cv::Mat colours, grey, picture;
  for (int i = 0; i < kFirst + kFilmed && sample.read(colours); ++i) {
    if (i < kFirst) continue;
    cv::extractChannel(colours, grey, 1);
    grey.convertTo(picture, CV_64F);
    draw_arm(picture, i, disc_px, level);
    writer.write(developed(picture, 0.5, random));
  }
}

class AnArmInTheWay : public testing::TestWithParam<double> {};

// The tip of the arm has about the outline of a disc seen from aside, and little of the disc is to
// be seen for a while: the arm must not be followed in its place. It is much brighter than the
// disc, or a little.
TEST_P(AnArmInTheWay, IsNotTakenForTheDisc) {
  const ScratchFolder folder("arm");
  const std::map<int, Eigen::Vector2d> truth = true_centres();
  write_with_arm(folder / "clip.mkv", truth.at(kCovers), GetParam());
  data::Scene scene = data::read_object(kSample / "object.json");
  const data::Camera camera = data::read_camera(kSample / "camera.json");
  const TrackResult result = track_video(folder / "clip.mkv", scene, camera);
  ASSERT_EQ(result.file.tracks.size(), 1u);
  const double radius_px = 0.04 * 1200.0 / 1.2;
  int free_of_the_arm = 0;
  for (const data::TrackSample& sample : result.file.tracks.front().samples) {
    const int frame = kFirst + static_cast<int>(sample.frame);
    EXPECT_LT((sample.centre_px - truth.at(frame)).norm(), 0.5 * radius_px) << "frame " << frame;
    if (frame > kCovers + 15) ++free_of_the_arm;
  }
  EXPECT_GE(free_of_the_arm, kFirst + kFilmed - kCovers - 20) << "found again at once";
}

INSTANTIATE_TEST_SUITE_P(BrightOrDark, AnArmInTheWay, testing::Values(165.0, 85.0));

}  // namespace
}  // namespace trochoid::tracking
