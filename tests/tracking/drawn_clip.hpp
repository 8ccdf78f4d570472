#pragma once
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>
#include <random>
#include <string>

namespace trochoid::tracking {

/// A folder of one test's own that vanishes with it.
class ScratchFolder {
 public:
  explicit ScratchFolder(const std::string& name)
      : path_(std::filesystem::temp_directory_path() /
              ("trochoid_" + name + "_" + std::to_string(::getpid()))) {
    std::filesystem::create_directories(path_);
  }
  ~ScratchFolder() { std::filesystem::remove_all(path_); }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  [[nodiscard]] std::filesystem::path operator/(const std::string& name) const {
    return path_ / name;
  }

 private:
  std::filesystem::path path_;
};

/// A mottled floor of about `level`, the same for the same seed.
inline cv::Mat drawn_floor(int width, int height, double level, unsigned seed = 3) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> phase(0.0, 6.28);
  const double a = phase(random), b = phase(random), c = phase(random);
  cv::Mat floor(height, width, CV_64F);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      floor.at<double>(y, x) = level + 6.0 * std::sin(0.21 * x + a) * std::sin(0.17 * y + b) +
                               4.0 * std::sin(0.05 * (x + 2 * y) + c);
  return floor;
}

/// Blends an elliptical disc into a picture, its rim blurred by a Gaussian of 0.7 px (first order
/// in the distance to the rim, exact for circles much larger than the blur).
inline void draw_disc(cv::Mat& picture, double x_px, double y_px, double a_px, double b_px,
                      double angle_rad, double level) {
  const double c = std::cos(angle_rad), s = std::sin(angle_rad);
  for (int y = 0; y < picture.rows; ++y)
    for (int x = 0; x < picture.cols; ++x) {
      const double u = c * (x - x_px) + s * (y - y_px), v = -s * (x - x_px) + c * (y - y_px);
      const double q = std::hypot(u / a_px, v / b_px);
      const double slope = std::hypot(u / (a_px * a_px), v / (b_px * b_px)) / std::max(q, 1e-6);
      const double outside_px = (q - 1.0) / std::max(slope, 1e-6);
      if (outside_px > 4.0) continue;
      const double cover = 0.5 * std::erfc(outside_px / (0.7 * std::sqrt(2.0)));
      double& pixel = picture.at<double>(y, x);
      pixel += cover * (level - pixel);
    }
}

/// 8-bit picture with Gaussian noise.
inline cv::Mat developed(const cv::Mat& picture, double noise, std::mt19937& random) {
  std::normal_distribution<double> normal(0.0, noise);
  cv::Mat out(picture.size(), CV_8U);
  for (int y = 0; y < picture.rows; ++y)
    for (int x = 0; x < picture.cols; ++x)
      out.at<std::uint8_t>(y, x) =
          cv::saturate_cast<std::uint8_t>(picture.at<double>(y, x) + normal(random));
  return out;
}

/// Lossless clip; `draw(picture, frame)` paints the bodies of each frame onto the floor.
inline void write_clip(const std::filesystem::path& path, const cv::Mat& floor, int frames,
                       double noise, const std::function<void(cv::Mat&, int)>& draw) {
  cv::VideoWriter writer(path.string(), cv::CAP_FFMPEG, cv::VideoWriter::fourcc('F', 'F', 'V', '1'),
                         100.0, floor.size(), false);
  std::mt19937 random(17);
  for (int i = 0; i < frames; ++i) {
    cv::Mat picture = floor.clone();
    draw(picture, i);
    writer.write(developed(picture, noise, random));
  }
}

}  // namespace trochoid::tracking
