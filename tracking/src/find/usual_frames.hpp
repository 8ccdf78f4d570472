#pragma once
#include <algorithm>

namespace trochoid::tracking {

/// How many frames of a recording of at most 125 a second a step from one to the next stands for:
/// 1, or less where a faster camera took them. Never more: a step over lost pictures is one look.
/// How far a body may have gone and how long something may hide it is told in these. What single
/// frames are wrong by is not: it goes by their number. Limits in frames were found on recordings
/// of 25 to 120 a second; in one of a thousand thirty frames are no reason to give a body up.
[[nodiscard]] inline double usual_frames(double step_s) {
  constexpr double kShortest_s = 0.008;
  return step_s > 0.0 ? std::min(1.0, step_s / kShortest_s) : 1.0;
}

}  // namespace trochoid::tracking
