#pragma once
#include <vector>

#include "link/glimpse.hpp"

namespace trochoid::tracking {

/// Measures frames again, from where their neighbours on both sides say the body was: those in
/// which it was lost, seen in an attitude these contradict, or fitted clearly worse than around.
/// @param closely only right where they say, and with what they know of the picture: a wider look
/// may lead from there to where it led before, to an edge of the face or of the shadow.
void mend_from_neighbours(const Background& background, const BodyFinder& finder,
                          std::vector<Glimpse>& glimpses, bool closely = false);

/// Doubts attitudes that the frames around still contradict: their covariance then holds both
/// places. A poor fit is doubted sooner, and so is any where the frames around usually lead exactly
/// there, unless one side still does: it may have been knocked. Whichever frames around are asked,
/// with the poor ones and without, have to agree.
void doubt_what_is_contradicted(const BodyFinder& finder, std::vector<Glimpse>& glimpses);

}  // namespace trochoid::tracking
