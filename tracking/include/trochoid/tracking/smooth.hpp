#pragma once
#include <cstdint>
#include <vector>

#include "trochoid/data/io.hpp"
#include "trochoid/data/track.hpp"

namespace trochoid::tracking {

/// One quantity over time as a smoother sees it.
struct SmoothState {
  double value = 0.0, sigma = 0.0;  ///< its unit
  double rate = 0.0;                ///< its unit per second
};

/// Rauch-Tung-Striebel smoothing of a quantity whose acceleration wanders at random; how much is
/// found by maximum likelihood.
/// @param t_s strictly increasing; at least four are measured.
/// @param value NaN where nothing was measured: there the result is an interpolation.
/// @param sigma of the measurements; all NaN, or 0 for most of them, which no measurement is: found
/// by maximum likelihood as well.
[[nodiscard]] std::vector<SmoothState> smooth(const std::vector<double>& t_s,
                                              const std::vector<double>& value,
                                              const std::vector<double>& sigma);

/// The smoothed columns of a track (docs/formats.md), one row per frame from its first to its last,
/// frames of short gaps interpolated and marked; longer gaps stay gaps. Between two of them at
/// least six samples are needed to tell how the body moves: fewer are left out.
struct SmoothTrack {
  data::Table table;
  std::int64_t interpolated = 0;  ///< rows
  std::int64_t left_out = 0;      ///< samples without a row
};
/// Pixels and metres are smoothed where all samples between two gaps have them (metres with their
/// covariance), else NaN.
/// @throws TrackError if a sample has no frame number.
[[nodiscard]] SmoothTrack smooth_track(const data::TrackFile& file);

}  // namespace trochoid::tracking
