#pragma once
#include "choose/contest.hpp"

namespace trochoid::fitting {

/// Looks for a rung that explains the tracks: the plainest model and, one more term at a time, all
/// extensions of the best so far; where the plainest explains nothing, all usual losses together
/// and fewer of them, rolling first and sliding then, a smooth floor, and what else slides.
/// @returns all that were tried, the plainest first; the others in the order in which they came.
[[nodiscard]] Rungs climb(const Contest& contest);

}  // namespace trochoid::fitting
