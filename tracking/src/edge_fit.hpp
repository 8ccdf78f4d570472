#pragma once
#include "edge_profile.hpp"

namespace trochoid::tracking {

/// What is assumed of the edge in a profile.
struct EdgeModel {
  double blur_px = 0.7;  ///< standard deviation of the Gaussian that blurs the step
  bool plate = false;    ///< the outer level is a multiple of the background plate
  /// Both levels may change along the profile (shading, soft shadows): linearly and with a bend,
  /// each by a few per cent of the light.
  bool shading = false;
  /// Variance of a sample on either side [8-bit levels squared].
  double inner_noise2 = 2.0, outer_noise2 = 2.0;
};

/// A blurred step found in a profile.
struct ProfileEdge {
  double offset_px = 0.0;             ///< of the edge along the normal
  double noise_variance_px2 = 0.0;    ///< of the offset, from the noise of the samples
  double shading_variance_px2 = 0.0;  ///< from not knowing how the levels go on under the blur
  double contrast = 0.0;              ///< outer minus inner level at the edge
  double inner_slope = 0.0, outer_slope = 0.0;  ///< of the levels at the edge [1/px]
  double inner = 0.0;                           ///< level of the body at the edge
  /// Squared residuals on either side and how many independent samples they are worth.
  double inner_square = 0.0, outer_square = 0.0, inner_freedom = 0.0, outer_freedom = 0.0;
  double gain = 0.0;  ///< log-likelihood over "no edge here"
};

/// Fits the levels beside a blurred step and its position in `iterations` Gauss-Newton steps from
/// `start_px`; one step gives the best linear estimate, fit for averaging however noisy. False if
/// no edge is found within `reach_px` of the start.
bool fit_edge(const Profile& profile, const EdgeModel& model, double start_px, double reach_px,
              int iterations, ProfileEdge& edge);

}  // namespace trochoid::tracking
