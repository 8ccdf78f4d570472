#pragma once
#include <span>

#include "choose/rung.hpp"

namespace trochoid::fitting {

/// Whether a rung slides and nobody said how its friction sets in.
[[nodiscard]] bool softness_is_open(const Rung& rung);

/// Fits a sliding rung whose friction may set in at once (Coulomb's law) or rise with the slip
/// speed, mu u/sqrt(u^2 + eps^2). The gentle law is fitted first, with eps a parameter like any
/// other, which the rung's scene then names as free: where friction does rise, Coulomb's law alone
/// finds no way. Coulomb's law, fitted from there, is kept where eps does not show by strong
/// evidence. Where the gentle law's search leads nowhere, which is dear to follow, Coulomb's law is
/// searched, and the gentle one gone on to from there. Of a body that rolls for a first part of the
/// track, which the gentle law would let creep, Coulomb's law is searched alone, and the gentle one
/// gone on to where that leaves something to be asked.
/// @param options  start and strategy of the search; a given eps is gone on from.
void fit_softly(std::span<const data::Track> tracks, const FitOptions& options, Rung& rung);

}  // namespace trochoid::fitting
