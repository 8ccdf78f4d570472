#pragma once
#include <optional>
#include <vector>

#include "edges/colour_window.hpp"
#include "edges/edge_stretch.hpp"
#include "geometry/exposure.hpp"
#include "geometry/outline_samples.hpp"
#include "pose/robust_step.hpp"
#include "trochoid/tracking/effort.hpp"

namespace trochoid::tracking {

/// Blur [px] of a picture about which nothing is known yet.
inline constexpr double kUsualBlurPx = 0.72;

/// Everything about the picture a refinement reads; windows in linear light.
struct Scenery {
  const data::Body& body;
  const data::Camera& camera;
  const data::PoseMotion& motion;
  LightWindow picture, plate;
  ColourWindow colour;
  double most_looks;
  Visit visit = Visit::only;
  data::PoseMotion::Step smear{};  ///< the body's motion during the exposure; empty: not known
  std::optional<Tints> tints{};    ///< for what luma says wrongly between colours
  std::optional<ExposureMotion> exposure{};  ///< the same, not only to first order
  const ShadingMemory* shading = nullptr;    ///< what other frames show; may be null
  MotionInReadout in_readout{};

  /// The same with both windows blurred.
  [[nodiscard]] Scenery blurred(double sigma_px) const {
    return {body,
            camera,
            motion,
            picture.blurred(sigma_px),
            plate.blurred(sigma_px),
            colour.blurred(sigma_px),
            most_looks,
            visit,
            smear,
            tints,
            exposure,
            shading,
            in_readout};
  }
};

/// How rounds of refinement look for edges.
struct Search {
  double blur_px;        ///< of the model edge; wider reaches further
  double extent_px;      ///< of the profiles to either side
  double reach_px;       ///< largest offset believed
  double first_step_px;  ///< between outline points, while the pose settles
  double step_px;        ///< of the last round
  int iterations;
  double settled_px;  ///< a smaller step is the last [px, rms along the outline]
  /// With everything that bears on accuracy: slopes beside the edges, edges between two surfaces of
  /// the body, what edge models may be wrong by.
  bool exact;
};

struct Refined {
  data::Pose<> pose;
  RobustSolution solution;
  std::vector<OutlineSample> samples;  ///< those with an edge
  std::vector<ProfileEdge> edges;
  std::vector<EdgeEquation> equations;
  std::vector<ShadingEvidence> shading;  ///< exact: beside each edge
  std::vector<double> blurs_px;          ///< exact: of each edge
  std::vector<size_t> places;            ///< not exact: along the outline of all samples
  double outline_px = 0.0;               ///< length of the predicted silhouette
  double seen_px = 0.0;                  ///< of it, with an edge exactly there
  double covered = 0.0;                  ///< share of the predicted outline with an accepted edge
  double wider_px = 0.0;  ///< exact: by how much the edges are wider than the model's
};

/// Iterates edges and pose; nothing if too few edges are found.
[[nodiscard]] std::optional<Refined> refine(const Scenery& scenery, const data::Pose<>& start,
                                            const Search& search);

/// How well the pose of an exact search is known: the rest of its solution.
void find_uncertainty(const Scenery& scenery, Refined& refined);

/// PoseMeasurement::accepted: fraction of the silhouette, 0..1, with an edge exactly there: near 1
/// for the right pose, a third or less for a pose that merely has settled among edges.
[[nodiscard]] double accepted_of(const Refined& refined);

/// How much farther out the rim is seen than the body's size and this pose put it.
[[nodiscard]] double larger_px(const Refined& refined);

/// PoseMeasurement::support_px: the gain of all edges, limited per edge so that no single one
/// decides, less what their residuals take, and a share of it if the body, whose size is known,
/// then looks too large or too small.
[[nodiscard]] double support_px_of(const Refined& refined);

/// 1 where the light beside all edges is even, towards 0 the more of where they lie hangs on how it
/// changes there (ProfileEdge::shading_variance_px2). An outline beside the body's own or on other
/// edges, such as that of its shadow, is mostly explained by such light: of two poses in one
/// picture that with the larger product of support and evenness is the likelier.
[[nodiscard]] double evenness_of(const Refined& refined);

}  // namespace trochoid::tracking
