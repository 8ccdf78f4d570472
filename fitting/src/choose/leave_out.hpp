#pragma once
#include "choose/contest.hpp"

namespace trochoid::fitting {

/// Everything but the last resort was added before it was known what that explains: terms the data
/// do not need any more are left out again, one at a time, as long as that costs no strong
/// evidence; those whose error bars say that it would are not tried.
/// @param from  one of the rungs, to which the smaller ones are added.
void step_down(const Contest& contest, const Rung& from, Rungs& rungs);

/// A friction that may be nothing is none: the same losses on a smooth floor, and fewer of them,
/// beside a rung that slides.
void let_go_of_friction(const Contest& contest, Rungs& rungs);

}  // namespace trochoid::fitting
