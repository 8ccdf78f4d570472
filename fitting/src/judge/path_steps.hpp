#pragma once
#include "problem/problem.hpp"
#include "trochoid/data/fit.hpp"

namespace trochoid::fitting {

/// Where a model does not explain a track: places where its path, a smooth curve before and after,
/// goes on by whole frames too far or too little. Such are told, as something to look at.
void tell_steps_of_path(const Problem& problem, data::Fit& fit);

}  // namespace trochoid::fitting
