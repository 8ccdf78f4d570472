#pragma once
#include <span>

#include "rung.hpp"

namespace trochoid::fitting {

/// Whether a rung slides and nobody said how its friction sets in.
[[nodiscard]] bool softness_is_open(const Rung& rung);

/// Fits a sliding rung whose friction may set in at once (Coulomb's law) or rise with the slip
/// speed, mu u/sqrt(u^2 + eps^2): the law that starts gently has a smooth cost and few valleys, so
/// it is searched first, and its eps followed down to the sharpest law the track wants. Coulomb's
/// law is kept where eps does not show by strong evidence; else eps counts as a parameter, stands
/// in the rung's scene, and its uncertainty widens the error bars.
/// @param above  a rung with one more term whose eps was fitted: starts from its solution and eps.
void fit_softly(std::span<const data::Track> tracks, const FitOptions& options, Rung& rung,
                const Rung* above = nullptr);

}  // namespace trochoid::fitting
