#pragma once
#include <span>

#include "problem/problem.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/data/track.hpp"
#include "trochoid/fitting/fit.hpp"

namespace trochoid::fitting {

/// Median time between samples.
[[nodiscard]] double frame_time_s(std::span<const data::Track> tracks);

/// The tracks' arcs, what may vary and where it starts, noise scales and the integrator's
/// tolerance: all that is known before the search.
/// @throws TrackError if a track is unusable or has fewer measurements than there are parameters.
[[nodiscard]] Problem prepare(std::span<const data::Track> tracks,
                              const model::Predictor& predictor, const data::Scene& scene,
                              const FitOptions& options);

}  // namespace trochoid::fitting
