#pragma once
#include <opencv2/core.hpp>

#include "link/track_assembly.hpp"

namespace trochoid::tracking {

/// How far a path's body goes, in multiples of its radius: from the fifth to the ninety-fifth of a
/// hundred positions, so that single slips do not count.
[[nodiscard]] double travel_in_radii(const BodyPath& path);

/// A circle that holds a body which hardly travels, in all of its frames, one at least.
[[nodiscard]] Ellipse reach_of(const BodyPath& path);

/// Whether what was followed ever moved, or turned: a reflection or a clamp that trembles with its
/// stand does not, nor does what all frames together deny: a path without any.
[[nodiscard]] bool moves(const BodyPath& path);

/// How many of the pixels that changed (CV_8UC1, non-zero) the body swept over.
[[nodiscard]] int changes_explained(const BodyPath& path, const cv::Mat& changed);

}  // namespace trochoid::tracking
