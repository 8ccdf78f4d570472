#pragma once
#include "choose/contest.hpp"

namespace trochoid::fitting {

/// A body that rolls first slides later: with what acts while it rolls, then with all that usually
/// acts.
/// @param known  a rung that rolls and explains a first part of the track.
/// @returns whether a rung was added that explains the track, or follows it to its end and is to go
/// on from.
bool slide_after_rolling(const Contest& contest, const Rung& known, Rungs& rungs);

/// Friction that sets in gently lets a body creep, which takes energy as rolling friction does, or
/// looks as if it rolled first and slid later under weak friction: tried, from the best rung that
/// rolls and at least follows the track, beside a chosen one that rolls or slides by Coulomb's law
/// and leaves residuals which hang together. Of one arc. Another law asks for the more evidence the
/// more they do: a tracker's errors go with the motion as creep does.
/// @returns whether rungs were added against which the chosen one has to stand.
bool creep_instead(const Contest& contest, const Rung& chosen, Rungs& rungs);

/// Of a body that slides from the beginning the gentle law's own search may lead nowhere with the
/// losses it begins with, and every later rung goes on by Coulomb's law: tried from a chosen one
/// that does, and leaves residuals which hang together. It takes the evidence that creep does.
/// @returns whether the chosen rung's friction sets in gently now.
bool soften_instead(const Contest& contest, const Rung& chosen, Rungs& rungs);

/// Losses that were only found of a body that may slide, where no search for one that rolls led
/// anywhere: rolling with them, where the chosen rung of one arc does not show how strong friction
/// is. @returns whether a rung was added, or found better, that explains the track.
bool roll_instead(const Contest& contest, const Rung& chosen, Rungs& rungs);

}  // namespace trochoid::fitting
