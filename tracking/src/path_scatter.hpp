#pragma once
#include <vector>

#include "trochoid/data/track.hpp"

namespace trochoid::tracking {

/// By what factors the variances of a track's centres are too small for how these scatter about
/// the path, at least 1, for each sample. Differences of the third to eighth order over equal steps
/// leave noise and no path; of a path too lively for the lower ones the highest tells most, and the
/// least of them counts. Errors that go on from frame to frame, most of what frames have in common,
/// do not show. Gaps, uneven frames and single outliers do not count.
[[nodiscard]] std::vector<double> unclaimed_scatter(const data::Track& track);

}  // namespace trochoid::tracking
