#pragma once
#include <optional>
#include <span>
#include <string>

#include "trochoid/data/fit.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/data/track.hpp"
#include "trochoid/fitting/fit.hpp"

namespace trochoid::fitting {

/// What several tracks, which one model does not explain together, say each by itself. Where
/// nothing explains them derivatives cannot tell that: each is fitted anew.
struct TracksApart {
  /// The model explains each of them, and they ask for different values of what they share.
  bool differ = false;
  std::string words;
};

/// @param together  the fit of all tracks, which leaves more than their noise.
/// @param scene, options  by which that was made.
/// @returns nothing for a single track, for pucks (one_friction.hpp) and where no track is
///          explained by itself either.
[[nodiscard]] std::optional<TracksApart> tracks_apart(std::span<const data::Track> tracks,
                                                      const data::Scene& scene,
                                                      const FitOptions& options,
                                                      const data::Fit& together);

/// Puts that into the verdict's words.
void tell_tracks_apart(const TracksApart& apart, data::Fit& fit);

}  // namespace trochoid::fitting
