#pragma once
#include <string>
#include <utility>
#include <vector>

#include "trochoid/data/track.hpp"

namespace trochoid::fitting {

/// Samples [first, last) of a track.
using SampleRange = std::pair<int, int>;

/// The samples between --from and --to: seconds ("1.5") or frames ("f120"); empty = open.
/// @throws InputError if a bound is not a number or nothing is left.
[[nodiscard]] SampleRange chosen_range(const data::Track& track, const std::string& from,
                                       const std::string& to);

}  // namespace trochoid::fitting
