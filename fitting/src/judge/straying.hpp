#pragma once
#include <span>

#include "trochoid/data/scene.hpp"
#include "trochoid/data/track.hpp"
#include "trochoid/fitting/fit.hpp"

// Whether a body held at a pivot only turns there: in the time chosen, from where it is let go.
namespace trochoid::fitting {

/// How far the centre of a body held at a pivot strays from its usual place [m], but for a tenth of
/// the samples; of several tracks the most, 0 without positions in metres.
/// @throws as chosen_range().
[[nodiscard]] double straying_m(std::span<const data::Track> tracks, const FitOptions& options);

/// Whether it strays further than a disc that turns face-on about a pivot near its middle: 7 times
/// the sigmas, or the samples' scatter where none are stated, and a fourteenth of the body's
/// radius.
/// @throws as chosen_range().
[[nodiscard]] bool leaves_pivot(std::span<const data::Track> tracks, const data::Scene& scene,
                                const FitOptions& options);

}  // namespace trochoid::fitting
