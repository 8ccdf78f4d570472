#pragma once
#include <vector>

#include "link/glimpse.hpp"

namespace trochoid::tracking {

/// Forgets spins that those of the frames around contradict: a glint, or the shade of an axle, can
/// look more like the mark than the mark does. A body turns about its own axis at a rate that
/// hardly changes within some frames; a spin is off if from three in four of the frames next to it
/// the body would have turned more than a radian otherwise than it turns between others as far
/// apart. Not where it goes evenly with the two before it, the two after it or one on each side: an
/// impact changes the rate. Where fewer than three are near nothing is forgotten, but for marks
/// that are dark where nearly all of that face are bright, or the other way round: a glint may turn
/// a mark into that, or leave of its face what looks like one.
void forget_spins_off_their_sequence(std::vector<Glimpse>& glimpses);

}  // namespace trochoid::tracking
