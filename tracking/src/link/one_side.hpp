#pragma once
#include <vector>

#include "link/glimpse.hpp"

namespace trochoid::tracking {

/// Follows the body back from where the path breaks, and on from there: for a stretch of frames the
/// fit may have sat on another edge of the body, its face for the whole of it, and those beyond
/// know better. What is found so replaces what was seen as far as it scores clearly higher.
void mend_from_one_side(const Background& background, const BodyFinder& finder,
                        std::vector<Glimpse>& glimpses);

}  // namespace trochoid::tracking
