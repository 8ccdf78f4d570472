#pragma once
#include "choose/contest.hpp"

namespace trochoid::fitting {

/// Of the known rungs the simplest that suffices, and from it on by what may do better, as long as
/// that changes which it is; then from others that are as good. Terms are added one at a time, by
/// what is gained at once, and those of a last resort all together: what never stood beside the
/// others may do as well as one of them.
/// @returns the rung that is chosen in the end; null where none could be fitted.
[[nodiscard]] const Rung* exchange_while_worth(const Contest& contest, Rungs& rungs);

}  // namespace trochoid::fitting
