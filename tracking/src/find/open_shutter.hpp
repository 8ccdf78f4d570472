#pragma once
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "find/background.hpp"
#include "find/body_finder.hpp"

namespace trochoid::tracking {

/// A frame with what was seen of a body in it and in the frame before, both with poses.
struct MovingLook {
  const Frame* frame;
  const Sighting *seen, *before;
};

/// How long the shutter is open, over the frame interval, by how edges in motion are smeared: they
/// are measured again with what was found until that is what they show. Nothing where they do not
/// tell: a body that hardly moves, pictures that are not sharp enough.
/// @param finder_with makes a finder that takes the shutter to be open for so long.
/// @param looks those with the most to tell are taken.
[[nodiscard]] std::optional<double> find_exposure_fraction(
    const std::function<std::unique_ptr<BodyFinder>(double)>& finder_with,
    const Background& background, std::vector<MovingLook> looks);

}  // namespace trochoid::tracking
