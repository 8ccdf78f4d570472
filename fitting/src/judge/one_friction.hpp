#pragma once
#include "problem/problem.hpp"
#include "trochoid/data/fit.hpp"

namespace trochoid::fitting {

/// For a puck with several arcs: fits each alone and notes whether one friction coefficient
/// explains them, by the chi-square of their scatter about the common one. What the arcs have in
/// common, scale, frame rate and a prior on the friction, does not enter, nor does what the fit
/// gave up. Beyond all chance the verdict is doubtful. Does nothing for other models or a single
/// arc.
void doubt_if_frictions_differ(const Problem& problem, data::Fit& fit);

}  // namespace trochoid::fitting
