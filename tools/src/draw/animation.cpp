#include "draw/animation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "common/progress.hpp"
#include "draw/canvas.hpp"
#include "draw/encoded_file.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::tools {
namespace {

constexpr int kSize_px = 640, kMargin_px = 40;
constexpr double kFrameRate_hz = 30.0, kLongest_s = 20.0, kTail_s = 0.6;
constexpr int kSubPixelBits = 4;  // sub-pixel bits of OpenCV's drawing functions
const cv::Scalar kGrey(200, 200, 200);

/// Table to picture, equal scales.
class AnimationView {
 public:
  AnimationView(const Eigen::VectorXd& x, const Eigen::VectorXd& y)
      : centre_(0.5 * (x.minCoeff() + x.maxCoeff()), 0.5 * (y.minCoeff() + y.maxCoeff())) {
    const double span = std::max(x.maxCoeff() - x.minCoeff(), y.maxCoeff() - y.minCoeff());
    scale_ = (kSize_px - 2 * kMargin_px) / (span > 0.0 ? span : 1.0);
  }
  [[nodiscard]] cv::Point operator()(double x, double y) const {
    const double one = 1 << kSubPixelBits;
    return {static_cast<int>(std::lround((0.5 * kSize_px + scale_ * (x - centre_.x())) * one)),
            static_cast<int>(std::lround((0.5 * kSize_px - scale_ * (y - centre_.y())) * one))};
  }

 private:
  Eigen::Vector2d centre_;
  double scale_ = 1.0;
};

}  // namespace

void check_animation_name(const std::filesystem::path& path) {
  if (path.extension() != ".mp4")
    throw InputError(fmt::format("{}: an animation is an mp4 file; name it .mp4", path.string()));
}

void check_has_path(const data::Table& trajectory, const std::filesystem::path& path) {
  const Eigen::VectorXd x = trajectory.column("x_m"), y = trajectory.column("y_m");
  if (x.size() < 2 || (x.isZero(0.0) && y.isZero(0.0)))
    throw InputError(fmt::format("{}: the run has no path to draw", path.string()));
}

void write_animation(const data::Table& trajectory, const std::filesystem::path& path) {
  const Eigen::VectorXd t = trajectory.column("t_s");
  const Eigen::VectorXd x = trajectory.column("x_m"), y = trajectory.column("y_m");
  check_has_path(trajectory, path);
  check_animation_name(path);
  const double span_s = t[t.size() - 1] - t[0];
  const double speed = std::max(1.0, span_s / kLongest_s);
  const int frames = std::max(2, static_cast<int>(span_s / speed * kFrameRate_hz));
  const AnimationView view(x, y);

  EncodedFile video(path, {kSize_px, kSize_px}, kFrameRate_hz, coding::kForViewing);
  Progress progress("animate");
  cv::Mat trace(kSize_px, kSize_px, CV_8UC3, cv::Scalar::all(255));
  Eigen::Index row = 0, tail = 0;
  for (int frame = 0; frame < frames; ++frame) {
    const double now = t[0] + span_s * frame / (frames - 1);
    for (; row + 1 < t.size() && t[row + 1] <= now; ++row)
      cv::line(trace, view(x[row], y[row]), view(x[row + 1], y[row + 1]), kGrey, 1, cv::LINE_AA,
               kSubPixelBits);
    while (tail < row && t[tail] < now - kTail_s * speed) ++tail;
    cv::Mat picture = trace.clone();
    for (Eigen::Index i = tail; i < row; ++i)
      cv::line(picture, view(x[i], y[i]), view(x[i + 1], y[i + 1]), palette::blue, 2, cv::LINE_AA,
               kSubPixelBits);
    cv::circle(picture, view(x[row], y[row]), 6 << kSubPixelBits, palette::vermillion, cv::FILLED,
               cv::LINE_AA, kSubPixelBits);
    cv::putText(picture, fmt::format("t = {:.2f} s", now), {12, kSize_px - 14},
                cv::FONT_HERSHEY_SIMPLEX, 0.55, {0, 0, 0}, 1, cv::LINE_AA);
    video.write(picture);
    progress.update(frame + 1, frames);
  }
  video.finish();
  video.commit();
}

}  // namespace trochoid::tools
