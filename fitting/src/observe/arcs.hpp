#pragma once
#include <string>
#include <utility>
#include <vector>

#include "trochoid/data/track.hpp"

namespace trochoid::fitting {

/// Samples [first, last) of a track.
using SampleRange = std::pair<int, int>;

/// The samples between two moments: seconds ("1.5") or frames ("f120"); empty = open.
/// @throws InputError as data::parse_window(), TrackError if nothing is left.
[[nodiscard]] SampleRange chosen_range(const data::Track& track, const std::string& from,
                                       const std::string& to);

/// End of the samples that are fitted when a share at the end is held back: at least one stays.
/// @throws InputError unless the share is in 0..1 and not 1.
[[nodiscard]] int kept_samples(int first, int last, double hold_back);

}  // namespace trochoid::fitting
