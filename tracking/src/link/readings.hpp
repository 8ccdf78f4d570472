#pragma once
#include <array>
#include <vector>

#include "link/glimpse.hpp"

namespace trochoid::tracking {

/// What frames of a path showed when they were looked at in one of BodyFinder::other_readings.
struct ReadingTally {
  double looked_at = 0.0;        ///< frames
  double found = 0.0;            ///< frames, of these, in which there was such a reading
  double log_score_ratio = 0.0;  ///< sum over those found: > 0 for this reading, < 0 for the chosen
  double square = 0.0;  ///< sum over those found of its squared distance, 1 being that reading's
  void add(const ReadingTally& other);
  /// Expected square, >= 0, of that distance: its mean times the probability that the whole path is
  /// to be read so. What all pictures of a recording say together for one of two readings has an
  /// error that they share.
  [[nodiscard]] double expected_square() const;
};
using ReadingTallies = std::array<ReadingTally, 2>;

/// What the pictures of a sequence leave open about how they are read.
struct ReadingDoubt {
  bool otherwise = false;  ///< some frame is read otherwise than it was tracked
  ReadingTallies tallies{};
};

/// Decides over a sequence which reading of its pictures was seen. For a stretch of frames the fit
/// may have sat on another edge, the face taken for the whole body or the edge of its wall for that
/// of the face; no single picture and no neighbour tells. Other readings of some frames, and where
/// the path breaks its continuation from either side, are followed as far as the pictures bear
/// them out; of all paths through what was found the likeliest counts [Viterbi 1967], by the scores
/// of its poses and by how evenly it goes on.
[[nodiscard]] ReadingDoubt choose_readings(const Background& background, const BodyFinder& finder,
                                           std::vector<Glimpse>& glimpses);

/// Sets Sighting::other_readings of every frame.
/// @param settled so many frames at the front stay as they are.
void place_other_readings(const BodyFinder& finder, std::size_t settled,
                          std::vector<Glimpse>& glimpses);

/// What the error of a frame on the floor and of its angles (px2 is 0) holds for readings that the
/// pictures of its whole path leave open: a wall that its shade hides may be there, whatever the
/// edges say.
[[nodiscard]] PoseSpread spread_over_readings(const ReadingTallies& of_path, const Sighting& seen);

}  // namespace trochoid::tracking
