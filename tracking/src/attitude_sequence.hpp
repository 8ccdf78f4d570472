#pragma once
#include <vector>

#include "glimpse.hpp"

namespace trochoid::tracking {

/// Decides over a sequence which of a tilt and its mirror image at the line of sight was seen.
/// One picture may speak for the wrong one; what all of them say, together with attitude and
/// angular velocity going on from frame to frame, seldom does: the most likely sequence counts
/// [Viterbi 1967]. Frames it turns over are measured again; where it cannot tell,
/// Sighting::attitude_doubtful is set and the covariance of the centre holds both.
void decide_attitudes(const Background& background, const BodyFinder& finder,
                      std::vector<Glimpse>& glimpses);

}  // namespace trochoid::tracking
