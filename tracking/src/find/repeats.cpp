#include "find/repeats.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace trochoid::tracking {

void Repeats::add(const cv::Mat& luma) {
  constexpr int kReduced = 8;           // averages noise, and what codecs do to it, away
  constexpr double kSame_levels = 1.0;  // rounding and coding
  constexpr double kLittle = 0.15;      // of how far the body's motion changes a picture: noise
  constexpr double kMoves_levels = 6.0;
  constexpr int kLongestRun = 8;  // pictures: no rate is converted to so many times itself
  cv::Mat now;
  const cv::Size size(std::max(1, luma.cols / kReduced), std::max(1, luma.rows / kReduced));
  cv::resize(luma, now, size, 0, 0, cv::INTER_AREA);
  const auto differs = [&](const cv::Mat& other) {
    return other.size() == now.size() ? cv::norm(now, other, cv::NORM_INF) : kMoves_levels;
  };
  const double step_levels = differs(last_);
  if (step_levels <= std::max(kSame_levels, kLittle * moved_levels_)) {
    run_levels_ = std::max(run_levels_, step_levels);
    ++run_;
    return;
  }
  // A body that turns back looks after the turn as it did before.
  const bool moved_on = differs(before_run_) >= kMoves_levels;
  const bool moved_before = moved_levels_ >= kMoves_levels;
  const bool moves_again =
      step_levels >= kMoves_levels && run_levels_ <= std::max(kSame_levels, kLittle * step_levels);
  if (run_ <= kLongestRun && moved_before && moves_again && moved_on) count_ += run_;
  moved_levels_ = step_levels;
  run_ = 0;
  run_levels_ = 0.0;
  before_run_ = last_;
  last_ = now;
}

}  // namespace trochoid::tracking
