#pragma once
#include <optional>
#include <vector>

#include "link/glimpse.hpp"

namespace trochoid::tracking {

/// The one lamp under which the shadow of a body explains most of how dark the floor is around it
/// in a sequence of frames, each in whichever of its two readings explains more. Nothing where no
/// shadow to speak of is seen, or where there is no other reading.
[[nodiscard]] std::optional<Lamp> find_lamp(const Background& background, const BodyFinder& finder,
                                            const std::vector<Glimpse>& glimpses);

/// Sets Sighting::shadow of every frame; without a lamp they stay.
void look_at_shadows(const Background& background, const BodyFinder& finder,
                     std::vector<Glimpse>& glimpses);

}  // namespace trochoid::tracking
