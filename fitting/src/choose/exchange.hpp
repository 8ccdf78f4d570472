#pragma once
#include "choose/contest.hpp"

namespace trochoid::fitting {

/// Chooses the simplest of the known rungs that suffices and fits its neighbours (one term less,
/// more or another one), as long as that changes the choice; then does the same from rungs that are
/// as good. Needed because terms were added one at a time by what each gained, and those of the
/// last resort together: two that were never tried side by side may be the better pair.
/// @returns the rung that is chosen in the end; null where none could be fitted.
[[nodiscard]] const Rung* exchange_while_worth(const Contest& contest, Rungs& rungs);

/// Adds what usual losses beside those of the chosen rung would make of its parameters, by the
/// score test, where they have not been fitted: residuals that hang together are no ground for a
/// fit, and yet which loss acts may be open.
void add_usual_losses(const Contest& contest, const Rung& chosen, Rungs& rungs);

}  // namespace trochoid::fitting
