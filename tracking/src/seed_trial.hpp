#pragma once
#include <map>
#include <memory>

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

/// Seen face on, a tilt and its mirror image are one, and what follows may go on in either. Tries
/// the stretches between such moments, other than the seed's own, against their mirror images and
/// follows those again that turn out wrong.
/// @param path by held index; @param ahead replaced if the last stretch is followed again.
using HeldPath = std::map<std::size_t, Sighting>;
void mend_mirrored(const std::vector<Frame>& held, const Background& background,
                   const BodyFinder& finder, std::size_t seed_index, HeldPath& path,
                   std::unique_ptr<Follower>& ahead);

}  // namespace trochoid::tracking
