#pragma once
#include <algorithm>
#include <cmath>

namespace trochoid::tools {

/// For how many pictures, shown at an even rate, each frame of a recording is out, so that they
/// keep pace with its times however uneven these are: every frame for one at least, none for more
/// than a viewer takes for a pause.
class Pace {
 public:
  /// @param rate_hz pictures per second of the recording's time, > 0.
  /// @param longest_s the longest pause, on the same clock.
  Pace(double rate_hz, double longest_s)
      : rate_hz_(rate_hz), most_(std::max(1.0, std::round(longest_s * rate_hz))) {}

  /// Of a frame that the next one follows so much later.
  [[nodiscard]] int pictures(double step_s) {
    constexpr double kMostAhead = 10.0;  // of the times: what is more is not made up for
    due_ += std::max(0.0, step_s) * rate_hz_;
    const double shown = std::clamp(std::round(due_), 1.0, most_);
    due_ = shown < most_ ? std::max(due_ - shown, -kMostAhead) : 0.0;
    return static_cast<int>(shown);
  }

 private:
  double rate_hz_, most_;
  double due_ = 0.0;  ///< pictures that should be out by now and are not
};

}  // namespace trochoid::tools
