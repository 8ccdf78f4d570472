#pragma once
#include <string>

#include "problem/problem.hpp"
#include "trochoid/data/fit.hpp"

namespace trochoid::fitting {

/// " in track 2" of several, else nothing.
[[nodiscard]] std::string in_track(const Problem& problem, const ArcData& arc);

/// Where a model does not explain a track: places where its path, a smooth curve before and after,
/// goes on by whole frames too far or too little. Such are told, as something to look at.
void tell_steps_of_path(const Problem& problem, data::Fit& fit);

}  // namespace trochoid::fitting
