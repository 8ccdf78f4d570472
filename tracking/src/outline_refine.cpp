#include "outline_refine.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "colour_window.hpp"

namespace trochoid::tracking {
namespace {

using Edge = data::OutlinePoint::Edge;

constexpr double kLeastInsidePx = 1.5;  // less does not show the level beside the edge

// Blur of an edge with this normal: the picture's own and the path of the body during the exposure.
double blur_along(const Scenery& scenery, const OutlineSample& sample, double blur_px) {
  const double smear = scenery.smear.size() > 0 ? sample.motion.dot(scenery.smear) : 0.0;
  return std::sqrt(blur_px * blur_px + smear * smear / 12.0);
}

// How far a profile may go before the blur of the body's next edge shows.
double clear_of_next(double next_px, double extent_px, double blur_px) {
  constexpr double kClearOfBlur = 1.5;
  return std::min(extent_px, next_px - kClearOfBlur * std::min(blur_px, 1.0));
}

// The edge near a point of the outline, with what a second fit needs.
struct Look {
  bool colour = false;
  Profile profile;
  EdgeModel model;
  ProfileEdge edge;
  double reach_px = 0.0;
  double steepness = 0.0;
  bool found = false;
};

bool look_for_edge(const Scenery& scenery, const OutlineSample& sample, const Search& search,
                   Look& look) {
  const double own_blur =
      look.colour ? std::hypot(search.blur_px, std::sqrt(kColourBlur2Px2)) : search.blur_px;
  const double blur = blur_along(scenery, sample, own_blur);
  const double widen = blur - search.blur_px;
  const double inside = clear_of_next(sample.inside_px, search.extent_px + 2.0 * widen, blur);
  const double outside = clear_of_next(sample.outside_px, search.extent_px + 2.0 * widen, blur);
  if (inside < kLeastInsidePx || outside < kLeastInsidePx) return false;
  static const LightWindow kNoPlate;
  const LightWindow& picture = look.colour ? scenery.colour : scenery.picture;
  const LightWindow& plate = sample.silhouette && !look.colour ? scenery.plate : kNoPlate;
  if (!sample_profile(picture, plate, sample.image_px, sample.normal_px, inside, outside,
                      look.profile))
    return false;
  look.reach_px = std::min(search.reach_px + widen, std::min(inside, outside));
  look.model.blur_px = blur;
  look.model.plate = plate_explains(look.profile, 1.5 * blur);
  look.model.shading = search.shading;
  look.found =
      fit_edge(look.profile, look.model, 0.0, look.reach_px, search.edge_iterations, look.edge);
  return look.found;
}

// Noise of a stretch of the outline: a single profile has too few degrees of freedom to know its
// own. The relief of a coin and the floor are not equally noisy.
void fit_with_noise_of_neighbours(const Search& search, const std::vector<OutlineSample>& samples,
                                  std::vector<Look>& looks) {
  constexpr int kNeighbours = 5;
  constexpr double kLeastNoise2 = 0.05;
  const int n = static_cast<int>(looks.size());
  std::vector<std::pair<double, double>> noise2(looks.size());
  for (int i = 0; i < n; ++i) {
    double inner = 0.0, outer = 0.0, inner_freedom = 1e-3, outer_freedom = 1e-3;
    for (int j = std::max(0, i - kNeighbours); j <= std::min(n - 1, i + kNeighbours); ++j) {
      if (samples[static_cast<size_t>(j)].edge != samples[static_cast<size_t>(i)].edge) continue;
      const ProfileEdge& e = looks[static_cast<size_t>(j)].edge;
      inner += e.inner_square, inner_freedom += e.inner_freedom;
      outer += e.outer_square, outer_freedom += e.outer_freedom;
    }
    noise2[static_cast<size_t>(i)] = {std::max(inner / inner_freedom, kLeastNoise2),
                                      std::max(outer / outer_freedom, kLeastNoise2)};
  }
  for (size_t i = 0; i < looks.size(); ++i) {
    Look& look = looks[i];
    look.model.inner_noise2 = noise2[i].first;
    look.model.outer_noise2 = noise2[i].second;
    look.found =
        fit_edge(look.profile, look.model, 0.0, look.reach_px, search.edge_iterations, look.edge);
  }
}

// How steeply the levels change beside a stretch of the outline, over its contrast [1/px]. Single
// profiles are too noisy for this, and their errors would go with those of their edges.
void find_steepness(const std::vector<OutlineSample>& samples, std::vector<Look>& looks) {
  constexpr int kNeighbours = 6;
  const int n = static_cast<int>(looks.size());
  for (int i = 0; i < n; ++i) {
    double inner = 0.0, outer = 0.0, contrast = 1e-3;
    for (int j = std::max(0, i - kNeighbours); j <= std::min(n - 1, i + kNeighbours); ++j) {
      const Look& look = looks[static_cast<size_t>(j)];
      if (!look.found ||
          samples[static_cast<size_t>(j)].edge != samples[static_cast<size_t>(i)].edge)
        continue;
      const ProfileEdge& e = look.edge;
      const double weight = 1.0 / (1e-3 + e.noise_variance_px2 + e.shading_variance_px2);
      inner += weight * e.inner_slope;
      outer += weight * e.outer_slope;
      contrast += weight * e.contrast;
    }
    looks[static_cast<size_t>(i)].steepness =
        (std::abs(inner) + std::abs(outer)) / std::abs(contrast);
  }
}

// What the model of an edge may be wrong by along a whole stretch of the outline [px]: how the
// light goes on under the blur, a sliver of shadow, rounded rims, levels beyond the range of the
// picture.
double model_sd_px(const Look& look, bool silhouette) {
  constexpr double kShapePx = 0.03, kOwnShapePx = 0.15, kClippedPx = 0.2, kMostPx = 2.0;
  constexpr double kAlongShare = 0.2;   // of the error of unknown shading, the rest is independent
  constexpr double kUnderBlurPx = 0.4;  // of a steep level's change goes unseen
  const double shape_px = silhouette ? kShapePx : kOwnShapePx;
  const double steep_px = std::min(kMostPx, kUnderBlurPx * look.steepness);
  const double clipped_px = look.profile.clipped() ? kClippedPx : 0.0;
  return std::sqrt(steep_px * steep_px + shape_px * shape_px + clipped_px * clipped_px +
                   kAlongShare * kAlongShare * look.edge.shading_variance_px2);
}

EdgeEquation equation_of(const OutlineSample& sample, const Look& look) {
  const bool bore = sample.edge == Edge::upper_bore || sample.edge == Edge::lower_bore;
  EdgeEquation e;
  e.motion = sample.motion.transpose();
  e.swell = bore ? -1.0 : 1.0;
  e.polarity = look.edge.contrast < 0.0 ? -1.0 : 1.0;
  e.model_px = model_sd_px(look, sample.silhouette);
  e.group = look.colour ? 3 : sample.silhouette ? (bore ? 1 : 0) : 2;
  e.colour = look.colour;
  e.direction_rad = std::atan2(sample.normal_px.y(), sample.normal_px.x());
  e.offset_px = look.edge.offset_px;
  // Colour planes of half the size hold fewer independent values, along the profile and across.
  const double shared = look.colour ? 1.5 : 1.0;
  e.variance_px2 = shared * (look.edge.noise_variance_px2 + look.edge.shading_variance_px2);
  e.arc_px = sample.arc_px;
  e.curve = static_cast<int>(sample.edge) + (look.colour ? 8 : 0);
  return e;
}

// Edges of one picture, luma or colour, along the samples of an outline.
void collect_in(const Scenery& scenery, const std::vector<OutlineSample>& all, const Search& search,
                bool colour, Refined& out) {
  std::vector<OutlineSample> samples;
  std::vector<Look> looks;
  for (const OutlineSample& sample : all) {
    if (!sample.silhouette && (colour || !search.own_edges)) continue;
    looks.emplace_back();
    looks.back().colour = colour;
    if (look_for_edge(scenery, sample, search, looks.back()))
      samples.push_back(sample);
    else
      looks.pop_back();
  }
  if (search.shading) fit_with_noise_of_neighbours(search, samples, looks);
  find_steepness(samples, looks);
  for (size_t i = 0; i < looks.size(); ++i) {
    if (!looks[i].found) continue;
    out.samples.push_back(samples[i]);
    out.edges.push_back(looks[i].edge);
    out.equations.push_back(equation_of(samples[i], looks[i]));
  }
}

bool collect(const Scenery& scenery, const data::Pose<>& pose, const Search& search, Refined& out,
             double& outline_px) {
  const auto all =
      outline_samples(scenery.body, pose, scenery.camera, scenery.motion, search.step_px);
  outline_px = 0.0;
  for (const OutlineSample& sample : all)
    if (sample.silhouette) outline_px += sample.arc_px;
  out.samples.clear();
  out.edges.clear();
  out.equations.clear();
  collect_in(scenery, all, search, false, out);
  if (!scenery.colour.empty()) collect_in(scenery, all, search, true, out);
  return !all.empty();
}

}  // namespace

Refined collect_edges(const Scenery& scenery, const data::Pose<>& pose, const Search& search) {
  Refined out;
  out.pose = pose;
  double outline_px = 0.0;
  collect(scenery, pose, search, out, outline_px);
  return out;
}

std::optional<Refined> refine(const Scenery& scenery, const data::Pose<>& start,
                              const Search& search) {
  Refined out;
  out.pose = start;
  const int n = scenery.motion.count();
  PoseMotion::Step prior(n);
  for (int i = 0; i < n; ++i) prior[i] = scenery.motion.scale(i);
  constexpr double kSettledPx = 0.003;
  double outline_px = 0.0;
  for (int i = 0; i < search.iterations; ++i) {
    if (!collect(scenery, out.pose, search, out, outline_px)) return std::nullopt;
    if (!solve_robustly(out.equations, prior, 0.15 * search.blur_px, out.solution))
      return std::nullopt;
    out.pose = scenery.motion.moved(out.pose, out.solution.step);
    double moved2 = 0.0;
    for (const auto& e : out.equations) moved2 += std::pow(e.motion.dot(out.solution.step), 2);
    if (moved2 < kSettledPx * kSettledPx * static_cast<double>(out.equations.size())) break;
  }
  double accepted_px = 0.0;
  for (size_t i = 0; i < out.equations.size(); ++i)
    if (out.samples[i].silhouette && out.equations[i].weight > 0.5)
      accepted_px += out.samples[i].arc_px;
  const double channels = scenery.colour.empty() ? 1.0 : 2.0;
  out.covered = outline_px > 0.0 ? accepted_px / (channels * outline_px) : 0.0;
  return out;
}

double estimate_blur_px(const Scenery& scenery, const Refined& refined) {
  constexpr std::array<double, 9> kTried{0.5, 0.6, 0.72, 0.86, 1.04, 1.25, 1.5, 1.8, 2.1};
  constexpr size_t kEdges = 60;
  std::vector<double> best;
  const size_t stride = std::max<size_t>(1, refined.samples.size() / kEdges);
  Profile profile;
  for (size_t i = 0; i < refined.samples.size(); i += stride) {
    const auto& sample = refined.samples[i];
    const auto& edge = refined.edges[i];
    const double noise2 =
        (edge.inner_square + edge.outer_square) / (edge.inner_freedom + edge.outer_freedom);
    if (refined.equations[i].weight < 0.5 || refined.equations[i].colour || !sample.silhouette ||
        sample.inside_px < 4.0 || edge.contrast * edge.contrast < 25.0 * noise2)
      continue;
    if (!sample_profile(scenery.picture, scenery.plate, sample.image_px, sample.normal_px, 3.0, 3.0,
                        profile))
      continue;
    // The same profile for every blur: only the model differs.
    double least = std::numeric_limits<double>::infinity(), blur = 0.0;
    for (const double tried : kTried) {
      ProfileEdge fit;
      const EdgeModel model{.blur_px = blur_along(scenery, sample, tried),
                            .plate = plate_explains(profile, 1.5 * tried),
                            .shading = true};
      if (!fit_edge(profile, model, refined.equations[i].offset_px, 2.0, 4, fit)) continue;
      const double square = fit.inner_square + fit.outer_square;
      if (square < least) least = square, blur = tried;
    }
    if (blur > 0.0) best.push_back(blur);
  }
  if (best.size() < 5) return kUsualBlurPx;
  const auto middle = best.begin() + static_cast<std::ptrdiff_t>(best.size() / 2);
  std::nth_element(best.begin(), middle, best.end());
  return *middle;
}

double outline_score(const Scenery& scenery, const data::Pose<>& pose, double blur_px) {
  // Gain at which an edge is certain; how far off it may be where the outline is right.
  constexpr double kCertain = 3.0, kTolerancePx = 0.3;
  const Search search{blur_px, 3.0, 1.5, 2.0, 1, false, false, 3};
  double score = 0.0, arc = 0.0;
  for (const OutlineSample& sample :
       outline_samples(scenery.body, pose, scenery.camera, scenery.motion, search.step_px)) {
    if (!sample.silhouette) continue;
    arc += sample.arc_px;
    double gain = 0.0;
    for (const bool colour : {false, true}) {
      if (colour && scenery.colour.empty()) continue;
      Look look;
      look.colour = colour;
      if (!look_for_edge(scenery, sample, search, look)) continue;
      const double off2 = look.edge.offset_px * look.edge.offset_px;
      const double tolerance2 = look.edge.noise_variance_px2 + kTolerancePx * kTolerancePx;
      gain = std::max(gain, look.edge.gain - 0.5 * off2 / tolerance2);
    }
    score += sample.arc_px * std::min(gain / kCertain, 1.0);
  }
  return arc > 0.0 ? score / arc : 0.0;
}

double evidence_of(const Refined& refined) {
  constexpr double kCertain = 3.0, kTolerancePx = 0.1;
  double evidence = 0.0;
  for (size_t i = 0; i < refined.edges.size(); ++i) {
    const ProfileEdge& edge = refined.edges[i];
    const EdgeEquation& e = refined.equations[i];
    const double misfit = 0.5 * e.residual_px * e.residual_px /
                          (edge.noise_variance_px2 + kTolerancePx * kTolerancePx);
    evidence += e.arc_px * std::max(0.0, std::min(edge.gain, kCertain) - misfit);
  }
  return evidence;
}

}  // namespace trochoid::tracking
