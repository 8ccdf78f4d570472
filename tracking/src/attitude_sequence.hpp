#pragma once
#include <optional>
#include <vector>

#include "background.hpp"
#include "body_finder.hpp"
#include "trochoid/tracking/frame_source.hpp"

namespace trochoid::tracking {

/// One body in one of consecutive frames; nothing where it was not seen.
struct Glimpse {
  const Frame* frame = nullptr;
  std::optional<Sighting> seen{};
};

/// Decides over a sequence which of a tilt and its mirror image at the line of sight was seen.
/// One picture may speak for the wrong one; what all of them say, together with attitude and
/// angular velocity going on from frame to frame, seldom does: the most likely sequence counts
/// [Viterbi 1967]. Frames it turns over are measured again; where it cannot tell,
/// Sighting::attitude_doubtful is set and the covariance of the centre holds both.
void decide_attitudes(const Background& background, const BodyFinder& finder,
                      std::vector<Glimpse>& glimpses);

/// Measures frames again, from where their neighbours on both sides say the body was: those in
/// which it was lost, seen in an attitude these contradict, or fitted clearly worse than around.
void mend_from_neighbours(const Background& background, const BodyFinder& finder,
                          std::vector<Glimpse>& glimpses);

}  // namespace trochoid::tracking
