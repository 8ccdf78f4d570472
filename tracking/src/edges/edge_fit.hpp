#pragma once
#include "edges/edge_profile.hpp"

namespace trochoid::tracking {

/// A blurred step found in a profile.
struct ProfileEdge {
  double offset_px = 0.0;             ///< of the edge along the normal
  double noise_variance_px2 = 0.0;    ///< of the offset, from the noise of the samples
  double shading_variance_px2 = 0.0;  ///< from not knowing how the levels go on under the blur
  /// From thinking a strip beside it less than it is, alike all along the edge.
  double strip_variance_px2 = 0.0;
  /// How much of the offset is that of the strip's inner edge: 0..1, and beyond where one of the
  /// two edges is dark towards what the other is bright to.
  double strip_share = 0.0;
  double unevenness = 1.0;  ///< 0..1: how much the light beside edges here changes
  double contrast = 0.0;    ///< outer minus inner level at the edge
  double mean_level = 0.0;  ///< of both levels at the edge
  double inner_slope = 0.0, outer_slope = 0.0;  ///< of the levels at the edge [1/px]
  /// By how much of the contrast the light outside may be less than where the same surface is
  /// brightest along the outline; 1 where that is not known.
  double dimmed = 1.0;
  double wider_px = 0.0;  ///< by how much it is wider than edges of this picture usually are
  double wider_variance_px2 = 0.0;  ///< of that, from the noise of the samples
  /// Variance of its blur beyond the model's, and the inverse of the variance of that from noise.
  double beyond_blur2_px2 = 0.0, beyond_blur2_information = 0.0;
  double gain = 0.0;  ///< log-likelihood over "no edge here", of one line
  int lines = 1;      ///< side by side that were looked at together
};

/// Fits one level on either side (outside a multiple of the background plate, if `plate`) and the
/// position of the step between them, blurred by a Gaussian of `blur_px`, in up to four
/// Gauss-Newton steps from s = 0: finds edges from afar. False if no edge is found within
/// `reach_px`.
bool fit_edge(const Profile& profile, double blur_px, bool plate, double reach_px,
              ProfileEdge& edge);

/// Squared residual of a profile without an edge: of the best line (or, with a plate, of the best
/// multiple of it plus a constant).
[[nodiscard]] double square_without_edge(const Profile& profile, bool plate);

}  // namespace trochoid::tracking
