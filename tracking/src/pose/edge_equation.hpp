#pragma once
#include <optional>
#include <vector>

#include "edges/colour_window.hpp"
#include "edges/edge_fit.hpp"
#include "edges/edge_stretch.hpp"
#include "geometry/outline_samples.hpp"
#include "pose/robust_step.hpp"

// From edges to equations of the pose, with what edges may be wrong by.
namespace trochoid::tracking {

/// What stretches of the outline look like; single profiles are too noisy for this, and their
/// errors would go with those of their edges.
struct EdgeSurroundings {
  double steepness = 0.0;  ///< of the levels beside the edge, over its contrast [1/px]
  double wider_px = 0.0;   ///< than a step that the picture blurs
  bool darker = false;     ///< the body than what is beside it
  double rise = 0.0;  ///< how fast the latter gets brighter farther out, over the contrast [1/px]
};

[[nodiscard]] std::vector<EdgeSurroundings> edge_surroundings(
    const std::vector<StretchProfile>& looks);

/// Blur moves what is seen of a curved edge towards the inside of the curve, as the light beside it
/// comes from more directions there: to first order by half the curvature times the variance.
[[nodiscard]] double rounded_by_blur_px(const Crossings& crossings, double blur_px);

/// What the model of an edge may be wrong by along a whole stretch of the outline [px]: how the
/// light goes on under the blur, a sliver of shadow, levels beyond the range of the picture.
[[nodiscard]] double model_sd_px(const ProfileEdge& edge, bool clipped,
                                 const EdgeSurroundings& around, bool silhouette);

/// By how much an edge is seen too far out beside the shadow of a body darker than the floor [px].
/// Where the floor gets brighter farther out there is a penumbra, and between it and the rim what
/// the lamp does not reach at all, narrower than the blur and about as dark as the body; near the
/// contact the light of the room is missing too, unless the floor is as bright there as where it is
/// brightest. The higher above the floor, the farther from the rim all that is. Sizes: means over
/// recordings made by two ray tracers, edges about the true outline.
[[nodiscard]] double shadow_px(const EdgeSurroundings& around, const ProfileEdge& edge,
                               double height_px);

/// What the sliver of a slightly rounded rim, too narrow to be seen apart, moves an edge by [px]:
/// it mirrors the room and not what the face mirrors, on the side towards the light something else
/// than on the far one (a rim without gloss does next to nothing). Taken as a share of the body's
/// light; an edge of little contrast moves the most.
[[nodiscard]] double sliver_px(const ProfileEdge& e);

/// What edges of a whole side of the body may be wrong by alike [px]: light beside them that is not
/// known by some share of it, and colours that luma mixes wrongly.
[[nodiscard]] double common_light_px(const std::optional<Tints>& tints, const ProfileEdge& e,
                                     double blur_px);

/// What an edge says of the pose, in luma or in colour.
[[nodiscard]] EdgeEquation equation_of(const OutlineSample& sample, const ProfileEdge& edge,
                                       bool colour);

/// An edge that is expected to be seen so much too far out; by how much really, differs along it.
void allow_for_shadow(double too_far_px, EdgeEquation& equation);

}  // namespace trochoid::tracking
