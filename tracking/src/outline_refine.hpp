#pragma once
#include <optional>
#include <vector>

#include "edge_fit.hpp"
#include "outline_samples.hpp"
#include "robust_step.hpp"

namespace trochoid::tracking {

/// Blur [px] of a picture about which nothing is known yet.
inline constexpr double kUsualBlurPx = 0.72;

/// Everything about the picture a refinement reads; windows in linear light.
struct Scenery {
  const data::Body& body;
  const data::Camera& camera;
  const PoseMotion& motion;
  LightWindow picture, plate;
  LightWindow colour;        ///< colour_window, or empty
  PoseMotion::Step smear{};  ///< the body's motion during the exposure; empty: not known

  /// The same with both windows blurred.
  [[nodiscard]] Scenery blurred(double sigma_px) const {
    return {body,
            camera,
            motion,
            picture.blurred(sigma_px),
            plate.blurred(sigma_px),
            colour.blurred(sigma_px),
            smear};
  }
};

/// How one round of refinement looks for edges.
struct Search {
  double blur_px;    ///< of the model edge; wider reaches further
  double extent_px;  ///< of the profiles to either side
  double reach_px;   ///< largest offset believed
  double step_px;    ///< between outline points
  int iterations;
  bool own_edges;       ///< also edges between two surfaces of the body
  bool shading;         ///< the levels beside an edge may change along the profile
  int edge_iterations;  ///< 1: best linear estimate of each edge
};

struct Refined {
  data::Pose<> pose;
  RobustSolution solution;
  std::vector<OutlineSample> samples;  ///< those with an edge
  std::vector<ProfileEdge> edges;
  std::vector<EdgeEquation> equations;
  double covered = 0.0;  ///< share of the predicted outline with an accepted edge
};

/// The edges along the outline of a pose, without moving it.
[[nodiscard]] Refined collect_edges(const Scenery& scenery, const data::Pose<>& pose,
                                    const Search& search);

/// Iterates edges and pose; nothing if too few edges are found.
[[nodiscard]] std::optional<Refined> refine(const Scenery& scenery, const data::Pose<>& start,
                                            const Search& search);

/// Blur of the edges of this picture [px], from the refined outline's own profiles.
[[nodiscard]] double estimate_blur_px(const Scenery& scenery, const Refined& refined);

/// Share of the predicted silhouette, 0..1, with an edge exactly there: near 1 for the right pose,
/// a third or less for a pose that merely has settled among edges.
[[nodiscard]] double outline_score(const Scenery& scenery, const data::Pose<>& pose,
                                   double blur_px);

/// What speaks for this pose rather than another one with nearly the same silhouette: the gain of
/// all edges, limited per edge so that no single one decides, less what their residuals take.
[[nodiscard]] double evidence_of(const Refined& refined);

}  // namespace trochoid::tracking
