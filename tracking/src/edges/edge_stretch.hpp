#pragma once
#include <array>
#include <vector>

#include "edges/edge_fit.hpp"
#include "edges/shading_prior.hpp"

namespace trochoid::tracking {

/// A profile across a predicted edge at s = 0.
struct StretchProfile {
  Profile profile;
  double blur_px = 0.7;  ///< of its edge, were it a Gaussian step
  /// An edge that moves during the exposure is the mean of steps at these places (about s = 0),
  /// each blurred by `sharp_px`; none: one step at s = 0, blurred by `blur_px`.
  static constexpr int kMostSteps = 12;
  int steps = 0;
  std::array<float, kMostSteps> step_at_px{};
  double sharp_px = 0.7;
  bool curved = false;  ///< light out of levels by the usual transfer curve: noise is even in these
  bool plate = false;   ///< the outer level is a multiple of the background plate
  int curve = 0;        ///< neighbours are profiles of the same curve
  int outside = 0;      ///< number of the surface there, such as the floor around a silhouette
  double direction_rad = 0.0;  ///< of the normal, in the picture
  /// Distance inwards to an edge of the body itself, too near to look between: a strip of unknown
  /// level; 0: none.
  double strip_px = 0.0;
  double reach_px = 2.0;  ///< largest offset believed
  bool found = false;     ///< out: an edge within reach
  ProfileEdge edge{};     ///< out
};

struct StretchFit {
  double wider_px = 0.0;  ///< by how much the blur should be larger, 0 if the edges do not tell
  std::vector<ShadingEvidence> shading;  ///< of each profile
};

/// Fits the profiles of an outline, linearly about s = 0: the best estimate for averaging, however
/// noisy. Each has its own levels, which may change along the normal, linearly and with a bend, by
/// a few per cent of the light (shading, soft shadows; along with an edge that moves); how noisy
/// either side is, is common to neighbours: the relief of a coin and the floor are not equally
/// noisy, and a single profile has too few degrees of freedom to know its own. Where the levels of
/// a surface are alike all along the outline, as on a plain floor under even light, profiles know
/// them from each other.
/// @param known what other frames show of the light beside these curves.
/// @param weighed light and blur too, by how noisy samples inside, outside and on the edge are, in
/// a second pass over what a first one leaves; without, only the offsets, and each profile knows
/// its own levels only.
StretchFit fit_stretches(std::vector<StretchProfile>& profiles, const ShadingMemory& known = {},
                         bool weighed = true);

}  // namespace trochoid::tracking
