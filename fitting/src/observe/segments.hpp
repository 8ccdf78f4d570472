#pragma once
#include <vector>

#include "observe/arcs.hpp"

namespace trochoid::fitting {

/// The stretches of samples [first, last) in which a puck slides freely: between release, impacts
/// (with a wall, another puck, a hand) and rest.
///
/// The path is cut where cubics in time, one to each piece, explain it at the least chi-square plus
/// a price for every piece (dynamic programming, so no threshold on noisy velocities); pieces that
/// one polynomial of degree 6 explains as well are joined again, as no impact parts them. Pieces at
/// rest or gaining speed (something pushes) are left out, and so is the sample on either side of a
/// cut, whose exposure may hold the impact.
/// @returns ranges into track.samples, in time order; empty if the body never slides freely.
[[nodiscard]] std::vector<SampleRange> sliding_ranges(const data::Track& track, SampleRange range);

/// Where a spin angle that begins at rest is let go: samples before were held or driven by a hand,
/// whose push ends with the first peak of the speed. range.first if it does not begin at rest.
[[nodiscard]] int released_at(const data::Track& track, SampleRange range);

}  // namespace trochoid::fitting
