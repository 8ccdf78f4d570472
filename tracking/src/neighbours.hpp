#pragma once
#include <vector>

#include "glimpse.hpp"
#include "trochoid/tracking/effort.hpp"

namespace trochoid::tracking {

/// Measures frames again, from where their neighbours on both sides say the body was: those in
/// which it was lost, seen in an attitude these contradict, or fitted clearly worse than around.
/// Then, but for a quick look, all frames from where they are, with the motion and the light that
/// the frames around know.
void mend_from_neighbours(const Background& background, const BodyFinder& finder,
                          std::vector<Glimpse>& glimpses, Effort effort = Effort::normal);

}  // namespace trochoid::tracking
