#pragma once
#include <cstddef>
#include <vector>

#include "link/glimpse.hpp"

namespace trochoid::tracking {

/// Measures frames again, from where their neighbours on both sides say the body was: those in
/// which it was lost, seen in an attitude these contradict, or fitted clearly worse than around.
/// @param closely only right where they say, and with what they know of the picture: a wider look
/// may lead from there to where it led before, to an edge of the face or of the shadow.
void mend_from_neighbours(const Background& background, const BodyFinder& finder,
                          std::vector<Glimpse>& glimpses, bool closely = false);

/// Follows the body back from where the path breaks, and on from there: for a stretch of frames the
/// fit may have sat on another edge of the body, its face for the whole of it, and those beyond
/// know better. What is found so replaces what was seen as far as clearly more speaks for it.
void mend_from_one_side(const Background& background, const BodyFinder& finder,
                        std::vector<Glimpse>& glimpses);

/// Measures frames again from where they are, and more closely, with what the frames around them
/// know: how the body moves during the exposure, the light beside its outline and how sharp the
/// picture is. While it was followed only the past was known. At a gap or an end the one neighbour
/// is carried on. Doubtful frames and those without a neighbour stay as they are.
/// @param settled so many frames at the front stay as they are.
void measure_again(const Background& background, const BodyFinder& finder, std::size_t settled,
                   std::vector<Glimpse>& glimpses);

/// Doubts attitudes that the frames around still contradict: their covariance then holds both
/// places. A poor fit is doubted sooner, and so is any where the frames around usually lead exactly
/// there, unless one side still does: it may have been knocked. Whichever frames around are asked,
/// with the poor ones and without, have to agree.
void doubt_what_is_contradicted(const BodyFinder& finder, std::vector<Glimpse>& glimpses);

}  // namespace trochoid::tracking
