#pragma once
#include <span>

#include "trochoid/data/scene.hpp"
#include "trochoid/data/track.hpp"

// Whether a body held at a pivot only turns there.
namespace trochoid::fitting {

/// How far the centre of a body held at a pivot strays from its mean place [m] (rms of a
/// coordinate); 0 without positions in metres.
[[nodiscard]] double straying_m(std::span<const data::Track> tracks);

/// Whether it strays further than a disc that turns face-on about a pivot near its middle: 5 times
/// the sigmas and a twentieth of the body's radius.
[[nodiscard]] bool leaves_pivot(std::span<const data::Track> tracks, const data::Scene& scene);

}  // namespace trochoid::fitting
