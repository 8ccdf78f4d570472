#pragma once
#include <cstddef>
#include <optional>
#include <vector>

#include "link/glimpse.hpp"
#include "link/track_assembly.hpp"
#include "trochoid/tracking/effort.hpp"

namespace trochoid::tracking {

/// Settles what a body's frames say together that none says alone: forgets what was not the body,
/// finds the lamp and where the colour planes lie, decides attitudes and readings, measures frames
/// again with what those around them know, and doubts what these still contradict. Lamp, chroma
/// site and tallies of the readings go to the path, whose frames stay as they are.
struct Linking {
  const Background& background;
  const BodyFinder& finder;
  bool alone;  ///< nothing else that moves may throw the shadows beside the body
  Effort effort;

  /// @param settled so many glimpses at the front have been through this with all their neighbours.
  /// @return what was seen in each glimpse before it was doubted, or forgotten, for what those
  /// around it say.
  std::vector<std::optional<Sighting>> operator()(std::size_t settled, BodyPath& path,
                                                  std::vector<Glimpse>& glimpses) const;
};

}  // namespace trochoid::tracking
