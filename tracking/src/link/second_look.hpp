#pragma once
#include <cstddef>
#include <vector>

#include "link/glimpse.hpp"

namespace trochoid::tracking {

/// Measures frames again from where they are, and more closely, with what the frames around them
/// know: how the body moves during the exposure, the light beside its outline and how sharp the
/// picture is. While it was followed only the past was known. At a gap or an end the one neighbour
/// is carried on. Doubtful frames and those without a neighbour stay as they are.
/// @param settled so many frames at the front stay as they are.
void measure_again(const Background& background, const BodyFinder& finder, std::size_t settled,
                   std::vector<Glimpse>& glimpses);

}  // namespace trochoid::tracking
