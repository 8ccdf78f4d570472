#include "find/repeats.hpp"

#include <opencv2/imgproc.hpp>

namespace trochoid::tracking {

void Repeats::add(const cv::Mat& luma) {
  constexpr int kReduced = 8;           // averages noise, and what codecs do to it, away
  constexpr double kSame_levels = 1.0;  // rounding and coding
  constexpr double kMoves_levels = 6.0;
  constexpr int kLongestRun = 8;  // longer, it may have been at rest
  cv::Mat now;
  cv::resize(luma, now, {}, 1.0 / kReduced, 1.0 / kReduced, cv::INTER_AREA);
  const double step_levels =
      last_.size() == now.size() ? cv::norm(now, last_, cv::NORM_INF) : kMoves_levels;
  last_ = now;
  if (step_levels <= kSame_levels) {
    ++run_;
    return;
  }
  if (run_ <= kLongestRun && moved_levels_ >= kMoves_levels && step_levels >= kMoves_levels)
    count_ += run_;
  moved_levels_ = step_levels;
  run_ = 0;
}

}  // namespace trochoid::tracking
