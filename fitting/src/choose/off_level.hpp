#pragma once
#include "choose/contest.hpp"

// A floor that is not level: hundredths of a degree lead a rolling body astray by more than a
// camera's noise.
namespace trochoid::fitting {

/// Tries a floor off level beside a rung that explains nothing of the track, or a first part.
/// @returns whether a rung was added that explains the track.
bool try_slope(const Contest& contest, const Rung& known, Rungs& rungs);

/// Searches for it from the beginning, with all losses that usually act, where none of the rungs
/// explains the track: from one that has gone astray nothing leads to a steep floor.
void search_on_slope(const Contest& contest, Rungs& rungs);

/// Tries it beside a chosen rung that leaves residuals which hang together. It asks for very strong
/// evidence, counted as what is left beside the slope lets it count: a tracker's errors go with the
/// motion, and may look like anything that does.
/// @returns whether a rung was added that does better.
bool slope_instead(const Contest& contest, const Rung& chosen, Rungs& rungs);

}  // namespace trochoid::fitting
