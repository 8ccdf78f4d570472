#pragma once
#include <optional>
#include <vector>

#include "find/background.hpp"
#include "find/body_finder.hpp"
#include "find/follower.hpp"
#include "find/silhouette.hpp"

namespace trochoid::tracking {

/// How much the shape of a region is that of a body, 0..1: a filled ellipse of the expected size
/// clear of the border; a hand, a merged pair or a shadowed body less.
[[nodiscard]] double region_score(const Silhouette& body, const BodyFinder& finder);

/// How well a body found without a prediction is seen, 0..1: its contrast times the fraction of its
/// outline with an edge; without a pose more or less (up to 1.7 times), the worse the edges lie on
/// an ellipse.
[[nodiscard]] double detection_score(const Sighting& seen);

/// Where a body may be followed from.
struct Seed {
  std::size_t held_index = 0;  ///< of the frame among the held ones
  Sighting seen;
};

/// Looks for a moving body in frames spread over `held`: regions the background does not explain,
/// most body-like first (compact, of the usual size, clear of the border), until one measures well.
/// @param explained for each held frame, places of bodies already followed.
[[nodiscard]] std::optional<Seed> find_seed(const std::vector<Frame>& held,
                                            const Background& background, const BodyFinder& finder,
                                            const std::vector<Follower::Others>& explained);

/// A body that turns in place: it never leaves its background, only its marks change. The circle of
/// any size that fits best about the middle of the largest changing region, in the middle frame.
[[nodiscard]] std::optional<Seed> find_seed_turning(const std::vector<Frame>& held,
                                                    const Background& background,
                                                    const BodyFinder& finder);

/// The body at a point of the first held frame, given by the user: the region there, or the circle
/// of any size that fits best.
[[nodiscard]] std::optional<Seed> find_seed_at(const std::vector<Frame>& held,
                                               const Background& background,
                                               const BodyFinder& finder,
                                               const Eigen::Vector2d& at_px);

}  // namespace trochoid::tracking
