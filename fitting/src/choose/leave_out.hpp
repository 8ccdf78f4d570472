#pragma once
#include "choose/contest.hpp"

namespace trochoid::fitting {

/// Leaves out terms that the data no longer need, one at a time, as long as that costs no strong
/// evidence: most were added before those of the last resort, which may explain what they did.
/// Terms whose error bars say that it would cost more are not tried.
/// @param from  one of the rungs, to which the smaller ones are added.
void step_down(const Contest& contest, const Rung& from, Rungs& rungs);

/// A friction that may be nothing is none: the same losses on a smooth floor, and fewer of them,
/// beside a rung that slides.
void let_go_of_friction(const Contest& contest, Rungs& rungs);

}  // namespace trochoid::fitting
