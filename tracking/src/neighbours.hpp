#pragma once
#include <vector>

#include "glimpse.hpp"

namespace trochoid::tracking {

/// Measures frames again, from where their neighbours on both sides say the body was: those in
/// which it was lost, seen in an attitude these contradict, or fitted clearly worse than around.
void mend_from_neighbours(const Background& background, const BodyFinder& finder,
                          std::vector<Glimpse>& glimpses);

}  // namespace trochoid::tracking
