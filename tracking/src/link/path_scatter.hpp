#pragma once
#include <vector>

#include "trochoid/data/track.hpp"

namespace trochoid::tracking {

enum class Measured { centre, theta, phi, psi };

/// By what factors the variances of what a track measures are too small for how it scatters about
/// its own course, at least 1, for each sample. Differences of the third to eighth order over equal
/// steps leave noise and no course; of a motion too lively for the lower ones the highest tells
/// most, and the least of them counts. Errors that go on from frame to frame, most of what frames
/// have in common, do not show. Gaps, uneven frames and single outliers do not count.
[[nodiscard]] std::vector<double> unclaimed_scatter(const data::Track& track, Measured what);

}  // namespace trochoid::tracking
