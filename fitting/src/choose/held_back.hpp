#pragma once
#include <span>

#include "choose/rung.hpp"

namespace trochoid::fitting {

/// Predicts the last third of the tracks from a fit of the others: of each track the stretch that
/// goes on there, to the next impact, without the readings that the fit of the whole has given up.
void predict_held_back(std::span<const data::Track> tracks, const FitOptions& options, Rung& rung);

}  // namespace trochoid::fitting
