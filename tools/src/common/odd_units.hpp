#pragma once
#include <string>

#include "trochoid/data/track.hpp"

namespace trochoid::tools {

/// Notes what in a track looks like another unit than its columns name, or like a slip: positions
/// far from the rest, samples seconds apart, angles of degrees. No unit can be told from numbers
/// alone, but no laboratory has these.
/// @param path  of the track, for the notes
void tell_odd_units(const std::string& path, const data::Track& track);

}  // namespace trochoid::tools
