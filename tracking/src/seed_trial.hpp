#pragma once
#include "body_search.hpp"

namespace trochoid::tracking {

/// How well a seed leads on to its neighbours in both directions of time: how much of the
/// outline is seen over a few frames and how well it fits, 0 where the body is lost. One picture
/// may show a tilt and its mirror image alike, or something that is no body at all; the next few do
/// not.
[[nodiscard]] double trial(const std::vector<Frame>& held, const Background& background,
                           const BodyFinder& finder, const Seed& seed);

/// The seed or its mirror image, whichever leads on better.
[[nodiscard]] Seed better_reading(const std::vector<Frame>& held, const Background& background,
                                  const BodyFinder& finder, Seed seed);

}  // namespace trochoid::tracking
