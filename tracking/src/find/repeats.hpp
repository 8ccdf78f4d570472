#pragma once
#include <cstdint>
#include <opencv2/core.hpp>

namespace trochoid::tracking {

/// Counts pictures that repeat the one before while what they show moves: a clip converted to a
/// higher rate, or a camera that stuttered. What is at rest, before and after, is no repetition.
class Repeats {
 public:
  void add(const cv::Mat& luma);
  [[nodiscard]] std::int64_t count() const { return count_; }

 private:
  cv::Mat last_;             ///< the picture before, reduced
  cv::Mat before_run_;       ///< the one before those that differ by next to nothing
  double moved_levels_ = 0;  ///< how far the last picture that was none differed
  int run_ = 0;              ///< pictures since then that differ by next to nothing
  double run_levels_ = 0.0;  ///< by how much at most
  std::int64_t count_ = 0;
};

}  // namespace trochoid::tracking
