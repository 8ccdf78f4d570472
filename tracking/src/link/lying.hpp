#pragma once
#include <vector>

#include "link/glimpse.hpp"

namespace trochoid::tracking {

/// Finds out when a body on the floor lies flat, and measures it as such then. A body that stands
/// on its rim at less than about 45 degrees cannot but precess; where for a fifth of a second its
/// axis stays, and the picture shows a lying body about as well, it lies. The outline of one that
/// lies in its own shadow may well pass for a tilted one.
void measure_what_lies(const Background& background, const BodyFinder& finder,
                       std::vector<Glimpse>& glimpses);

}  // namespace trochoid::tracking
