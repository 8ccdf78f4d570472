#pragma once
#include <array>
#include <vector>

#include "glimpse.hpp"

namespace trochoid::tracking {

/// What the pictures of a sequence leave open about how they are read.
struct ReadingDoubt {
  bool otherwise = false;  ///< some frame is read otherwise than it was tracked
  /// Probability of each of BodyFinder::other_readings all along these frames, times the mean
  /// square of how far off what they then show is, of the way to that reading.
  std::array<double, 2> may_be{};
};

/// Decides over a sequence which reading of its pictures was seen. For a stretch of frames the fit
/// may have sat on another edge, the face taken for the whole body or the edge of its wall for that
/// of the face; no single picture and no neighbour tells. Other readings of some frames, and where
/// the path breaks its continuation from either side, are followed as far as the pictures bear
/// them out; of all paths through what was found the likeliest counts [Viterbi 1967], by what
/// speaks for its poses and by how evenly it goes on.
[[nodiscard]] ReadingDoubt choose_readings(const Background& background, const BodyFinder& finder,
                                           std::vector<Glimpse>& glimpses);

/// Sets Sighting::other_readings of every frame: a wall that its shade hides may be there, whatever
/// the edges say.
/// @param settled so many frames at the front stay as they are.
void doubt_readings(const ReadingDoubt& doubt, const BodyFinder& finder, std::size_t settled,
                    std::vector<Glimpse>& glimpses);

}  // namespace trochoid::tracking
