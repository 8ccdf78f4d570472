#pragma once
#include <vector>

#include "glimpse.hpp"

namespace trochoid::tracking {

/// Decides over a sequence which reading of its pictures was seen. For a stretch of frames the fit
/// may have sat on another edge, the face taken for the whole body or the edge of its wall for that
/// of the face; no single picture and no neighbour tells. Other readings of some frames, and where
/// the path breaks its continuation from either side, are followed as far as the pictures bear
/// them out; of all paths through what was found the likeliest counts [Viterbi 1967], by what
/// speaks for its poses and by how evenly it goes on.
/// @return whether that was another one than tracked in any frame.
[[nodiscard]] bool choose_readings(const Background& background, const BodyFinder& finder,
                                   std::vector<Glimpse>& glimpses);

}  // namespace trochoid::tracking
