#pragma once
#include <string>
#include <vector>

#include "choose/rung.hpp"

namespace trochoid::fitting {

/// Those that are told of: of several minima of one model the likeliest, or the chosen one.
/// @param chosen null where none is.
[[nodiscard]] std::vector<const Rung*> told(const Rungs& rungs, const Rung* chosen);

/// What the comparison of all rungs says, as a sentence or two.
/// @param lacks_something  false where it is known what else keeps the chosen one from explaining.
[[nodiscard]] std::string sentence(const Rungs& rungs, const Rung& chosen, const Ladder& ladder,
                                   data::FitVerdict verdict, bool lacks_something = true);

}  // namespace trochoid::fitting
