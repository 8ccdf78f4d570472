#pragma once
#include <string>
#include <vector>

#include "choose/rung.hpp"

namespace trochoid::fitting {

/// What the comparison of all rungs says, as a sentence or two.
[[nodiscard]] std::string sentence(const Rungs& rungs, const Rung& chosen, const Ladder& ladder);

}  // namespace trochoid::fitting
