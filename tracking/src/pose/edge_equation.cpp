#include "pose/edge_equation.hpp"

#include <algorithm>
#include <cmath>

namespace trochoid::tracking {
namespace {

using Edge = data::OutlinePoint::Edge;

// Contrast over mean level: how strong an edge is.
double tone_of(const ProfileEdge& edge) {
  constexpr double kLeast = 0.2, kMost = 2.0;  // black beside white
  return std::clamp(std::abs(edge.contrast) / std::max(edge.mean_level, 1.0), kLeast, kMost);
}

// What is not known of the light right beside an edge, relative to usual surroundings: it goes with
// what is seen of it a little farther off.
double unknown_share(const ProfileEdge& edge) {
  constexpr double kUsual = 0.1, kLeast = 0.15, kMost = 2.0;
  return std::clamp(std::sqrt(edge.unevenness / kUsual), kLeast, kMost);
}

}  // namespace

std::vector<EdgeSurroundings> edge_surroundings(const std::vector<StretchProfile>& looks) {
  constexpr int kNeighbours = 4;
  const int n = static_cast<int>(looks.size());
  std::vector<EdgeSurroundings> out(looks.size());
  for (int i = 0; i < n; ++i) {
    double inner = 0.0, outer = 0.0, contrast = 1e-3;
    double wider = 0.0, wider_variance = 0.0, count = 1e-3;
    for (int j = std::max(0, i - kNeighbours); j <= std::min(n - 1, i + kNeighbours); ++j) {
      const StretchProfile& look = looks[static_cast<size_t>(j)];
      if (!look.found || look.curve != looks[static_cast<size_t>(i)].curve) continue;
      const ProfileEdge& e = look.edge;
      const double weight = 1.0 / (1e-3 + e.noise_variance_px2 + e.shading_variance_px2);
      inner += weight * e.inner_slope;
      outer += weight * e.outer_slope;
      contrast += weight * e.contrast;
      wider += e.wider_px, wider_variance += e.wider_variance_px2, count += 1.0;
    }
    const double wider2 = std::max(0.0, wider * wider - wider_variance);  // beyond the noise
    out[static_cast<size_t>(i)] = {(std::abs(inner) + std::abs(outer)) / std::abs(contrast),
                                   std::sqrt(wider2) / count, contrast > 0.0,
                                   std::max(0.0, outer / contrast)};
  }
  return out;
}

double rounded_by_blur_px(const Crossings& crossings, double blur_px) {
  constexpr double kMostCurvature = 0.5;  // as far as first order goes
  double sum = 0.0;
  for (int i = 0; i < crossings.count; ++i)
    sum += crossings.at[static_cast<size_t>(i)].curvature_per_px;
  const double curvature = std::clamp(sum / crossings.count, -kMostCurvature, kMostCurvature);
  return -0.5 * curvature * blur_px * blur_px;
}

double model_sd_px(const ProfileEdge& edge, bool clipped, const EdgeSurroundings& around,
                   bool silhouette) {
  constexpr double kShapePx = 0.015, kOwnShapePx = 0.3, kClippedPx = 0.2, kMostPx = 2.0;
  constexpr double kAlongShare = 0.2;   // of the error of unknown shading, the rest is independent
  constexpr double kUnderBlurPx = 0.4;  // of a steep level's change goes unseen
  const double shape_px = silhouette ? unknown_share(edge) * kShapePx / tone_of(edge) : kOwnShapePx;
  const double steep_px = std::min(kMostPx, kUnderBlurPx * around.steepness);
  const double clipped_px = clipped ? kClippedPx : 0.0;
  // An edge wider than the picture's blur is not that of the body alone.
  constexpr double kPerWiderPx = 1.0;
  const double wide_px = std::min(kMostPx, kPerWiderPx * around.wider_px);
  return std::sqrt(wide_px * wide_px + steep_px * steep_px + shape_px * shape_px +
                   clipped_px * clipped_px + kAlongShare * kAlongShare * edge.shading_variance_px2);
}

double shadow_px(const EdgeSurroundings& around, const ProfileEdge& edge, double height_px) {
  constexpr double kPerRisePx2 = 2.5, kMostPx = 0.6, kPenumbraHeightPx = 25.0;
  constexpr double kContactPx = 0.04, kContactHeightPx = 12.0, kContactDims = 0.03;
  if (!around.darker) return 0.0;
  return std::min(kMostPx, kPerRisePx2 * around.rise) * std::exp(-height_px / kPenumbraHeightPx) +
         kContactPx * std::min(1.0, edge.dimmed / kContactDims) *
             std::exp(-height_px / kContactHeightPx);
}

double sliver_px(const ProfileEdge& e) {
  constexpr double kSharePx = 0.04;  // a sliver of a third of a pixel, brighter by an eighth
  constexpr double kMostPx = 0.5;
  const double inner = e.mean_level - 0.5 * e.contrast;
  return std::min(kMostPx, kSharePx * std::max(inner, 0.0) / std::max(std::abs(e.contrast), 1.0));
}

double common_light_px(const std::optional<Tints>& tints, const ProfileEdge& e, double blur_px) {
  constexpr double kUnknownPx = 0.03;    // beside an edge as strong as its mean level
  const double step_px = 2.5 * blur_px;  // of a Gaussian edge: shift per share of its step
  const double tone = tone_of(e);
  constexpr double kMostMixing = 0.3, kMixingShare = 0.85;  // the rest shading takes up
  const double mixing =
      tints ? mixing_error(*tints, e.mean_level - 0.5 * e.contrast, e.mean_level + 0.5 * e.contrast)
            : 0.0;
  return std::hypot(unknown_share(e) * kUnknownPx / (tone * std::sqrt(tone)),
                    kMixingShare * step_px * std::min(kMostMixing, std::abs(mixing)));
}

EdgeEquation equation_of(const OutlineSample& sample, const ProfileEdge& edge, bool colour) {
  const bool bore = is_bore(sample.edge);
  EdgeEquation e;
  e.motion = sample.motion.transpose();
  if (edge.strip_share != 0.0)
    e.motion += edge.strip_share * (sample.near_motion - sample.motion).transpose();
  e.swell = bore ? -1.0 : 1.0;
  e.polarity = edge.contrast < 0.0 ? -1.0 : 1.0;
  constexpr double kMostTone = 2.0;
  e.tone = std::clamp(edge.contrast / std::max(edge.mean_level, 1.0), -kMostTone, kMostTone);
  // Walls are lit like nothing else, and all along the rim alike.
  constexpr double kLowerPx = 0.03;
  if (sample.edge == Edge::lower_rim || sample.edge == Edge::lower_bore)
    e.lower_px = std::hypot(unknown_share(edge) * kLowerPx, std::sqrt(edge.strip_variance_px2));
  e.group = colour ? 3 : sample.silhouette ? (bore ? 1 : 0) : 2;
  e.colour = colour;
  e.direction_rad = std::atan2(sample.normal_px.y(), sample.normal_px.x());
  e.normal = sample.normal_px;
  e.offset_px = edge.offset_px;
  e.variance_px2 = edge.noise_variance_px2 + edge.shading_variance_px2;
  e.arc_px = sample.arc_px;
  e.curve = colour ? 8 + (bore ? 1 : 0) : static_cast<int>(sample.edge);
  return e;
}

void allow_for_shadow(double too_far_px, EdgeEquation& equation) {
  constexpr double kUnsureShare = 0.4;
  equation.offset_px -= too_far_px;
  equation.shadow_px = too_far_px;
  equation.model_px = std::hypot(equation.model_px, kUnsureShare * too_far_px);
}

}  // namespace trochoid::tracking
