#pragma once
#include <span>

#include "trochoid/data/fit.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/data/track.hpp"
#include "trochoid/fitting/fit.hpp"

namespace trochoid::fitting {

/// The simplest model that suffices, with all that were tried in `fit.comparison`, also
/// those that could not be fitted.
struct Comparison {
  data::Fit fit;      ///< of the recommended model; `recommendation` says why in a sentence
  data::Scene scene;  ///< the given one with that model's terms, so that the fit can be replayed
};

/// Fits the rungs of the ladder that make sense for the scene's support. Starts from the model
/// without losses and adds, one at a time, the loss that lowers BIC most (floor: linear and
/// quadratic air couple, air force, gap layer, rolling, pivoting and contour friction, and sliding;
/// pivot: drag; puck: air force, and a spin that nothing but the path shows; spin-down: dry,
/// viscous and quadratic couple, a weight out of balance, and dry friction that weakens with
/// speed). Where that model explains nothing, all usual losses of a floor come first and fewer of
/// them next; what explains a first part of the track alone is the start of rolling with one loss
/// more, and of rolling first and sliding then. What is chosen of one record has to stand against
/// creep, which friction that sets in gently lets happen, where it rolls or slides by Coulomb's law
/// and leaves residuals that hang together. A floor may also be smooth, with losses of its own;
/// one that the scene names so is nothing else. Terms the scene names beforehand give starting
/// values only, and every rung frees the terms it has, whatever [fit] free lists. Every rung is
/// judged by AICc and BIC (both allow for residuals that hang together), whiteness of residuals and
/// the prediction of the last third of the track from the first two. Recommended is the rung with
/// the fewest parameters within 6 of the least BIC; its error bars allow for what rungs with other
/// terms that are not ruled out make of its parameters, and for those with further terms where its
/// residuals are white or nearly so, in full within 6 of its BIC or where these terms act on nearly
/// every body. Where the fitted ring or disc turns retrograde, the recommendation says which losses
/// explain that and whether the track can tell.
/// @throws InputError as fit() does for the model without losses; for names under [fit] that none
///         of the models has.
[[nodiscard]] Comparison compare(std::span<const data::Track> tracks, const data::Scene& scene,
                                 const FitOptions& options = {});

/// What compare() says of the names under [fit] whatever the tracks: before there are any, which
/// takes time. Of a scene that lacks what all of the models need it says nothing.
/// @throws InputError for names that none of the models has.
void check_compared(const data::Scene& scene, const FitOptions& options = {});

}  // namespace trochoid::fitting
