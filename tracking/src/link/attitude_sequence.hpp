#pragma once
#include <vector>

#include "link/glimpse.hpp"

namespace trochoid::tracking {

/// A frame that may show the mirror image of the attitude chosen for it.
struct AttitudeDoubt {
  std::size_t at;  ///< among the glimpses
  /// Half of what lies between the two centres, their standard deviation then: in the picture and
  /// on the floor.
  Eigen::Vector2d off_px = Eigen::Vector2d::Zero(), off_m = Eigen::Vector2d::Zero();
  double off_theta_rad = 0.0;  ///< and between the two tilts
};

/// Decides over a sequence which of a tilt and its mirror image at the line of sight was seen.
/// One picture may support the wrong one; what all of them say, together with attitude and
/// angular velocity going on from frame to frame, seldom does: the most likely sequence counts
/// [Viterbi 1967]. Frames it turns over are measured again.
/// @return the frames in which it cannot tell, for doubt_attitudes.
[[nodiscard]] std::vector<AttitudeDoubt> decide_attitudes(const Background& background,
                                                          const BodyFinder& finder,
                                                          std::vector<Glimpse>& glimpses);

/// Sets Sighting::attitude_doubtful; the errors of centre and tilt hold both attitudes.
void doubt_attitudes(const std::vector<AttitudeDoubt>& doubts, std::vector<Glimpse>& glimpses);

}  // namespace trochoid::tracking
