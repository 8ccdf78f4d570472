#include "pose/outline_refine.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "edges/colour_edges.hpp"
#include "edges/colour_window.hpp"
#include "geometry/contour.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {
namespace {

using Edge = data::OutlinePoint::Edge;

// An edge of the predicted silhouette counts as seen when it is about so near.
constexpr double kSeenReachPx = 1.5, kSeenWithinPx = 0.3;
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

// The edge of an outline that sweeps over the picture during the exposure.
static_assert(Sweep::kMost <= StretchProfile::kMostSteps);

void set_sweep(const Sweep& sweep, double own_blur_px, StretchProfile& look) {
  const double mean = sweep.mean_px(), step = sweep.step_px();
  look.steps = sweep.count;
  look.sharp_px = std::sqrt(own_blur_px * own_blur_px + step * step / 12.0);
  double square = 0.0;
  for (int k = 0; k < sweep.count; ++k) {
    const double at = sweep.shift_px[static_cast<size_t>(k)] - mean;
    look.step_at_px[static_cast<size_t>(k)] = static_cast<float>(at);
    square += at * at / sweep.count;
  }
  look.blur_px = std::sqrt(look.sharp_px * look.sharp_px + square);
}

// Whatever the picture of luma or colour shows near a point of the outline; of a crossing, the
// pixels themselves.
bool look_at(const Scenery& scenery, const OutlineSample& sample, const Sweep* sweep,
             const Crossings* crossings, const Search& search, bool colour, StretchProfile& look) {
  if (sweep != nullptr && sweep->count == 0) return false;
  // Between two surfaces of the body there is no room for a ramp.
  if (!sample.silhouette) sweep = nullptr;
  const double own_blur =
      colour ? std::hypot(search.blur_px, std::sqrt(kColourBlur2Px2)) : search.blur_px;
  look.steps = 0;
  look.blur_px = blur_along(scenery, sample, own_blur);
  double half_range = 0.0, middle = 0.0;
  if (sweep != nullptr) {
    set_sweep(*sweep, own_blur, look);
    half_range = sweep->half_range_px();
    middle = sweep->mean_px();
  }
  const double widen = look.blur_px - search.blur_px;
  constexpr double kMostExtentPx = 15.5;  // as many pixels as a profile holds
  const double extent =
      std::min(kMostExtentPx, search.extent_px + std::max(half_range, 2.0 * widen));
  double inside = clear_of_next(sample.inside_px - half_range, extent, look.blur_px);
  // A wall too narrow to look past: a strip of its own beside the face.
  look.strip_px = 0.0;
  if (search.exact && sample.edge == Edge::lower_rim && inside < extent) {
    constexpr double kTooNarrowPx = 0.25;  // to show a level of its own
    look.strip_px = sample.inside_px > kTooNarrowPx ? sample.inside_px : 0.0;
    inside = extent;
  }
  const double outside = clear_of_next(sample.outside_px - half_range, extent, look.blur_px);
  const double least = kLeastInsidePx + half_range;
  if (inside < least || outside < least) return false;
  static const LightWindow kNoPlate;
  const LightWindow& picture = colour ? scenery.colour.levels : scenery.picture;
  const LightWindow& plate = sample.silhouette && !colour ? scenery.plate : kNoPlate;
  const bool sampled =
      crossings != nullptr
          ? read_pixels(picture, plate, *crossings, middle, {inside, outside}, look.profile)
          : sample_profile(picture, plate, sample.image_px + middle * sample.normal_px,
                           sample.normal_px, {inside, outside}, look.profile);
  if (!sampled) return false;
  look.curve = static_cast<int>(sample.edge) + (sample.silhouette ? 0 : 8);
  look.outside = sample.silhouette ? -1 : look.curve;
  look.direction_rad = std::atan2(sample.normal_px.y(), sample.normal_px.x());
  look.reach_px = std::min(search.reach_px + widen, std::min(inside, outside));
  look.curved = !colour && scenery.camera.transfer != data::Transfer::linear;
  look.plate = plate_explains(look.profile, std::max(1.5 * look.blur_px, half_range));
  return true;
}

// Blur moves what is seen of a curved edge towards the inside of the curve, as the light beside it
// comes from more directions there: to first order by half the curvature times the variance.
double rounded_by_blur_px(const Crossings& crossings, double blur_px) {
  constexpr double kMostCurvature = 0.5;  // as far as first order goes
  double sum = 0.0;
  for (int i = 0; i < crossings.count; ++i)
    sum += crossings.at[static_cast<size_t>(i)].curvature_per_px;
  const double curvature = std::clamp(sum / crossings.count, -kMostCurvature, kMostCurvature);
  return -0.5 * curvature * blur_px * blur_px;
}

// What stretches of the outline look like; single profiles are too noisy for this, and their errors
// would go with those of their edges.
struct EdgeSurroundings {
  double steepness = 0.0;  // of the levels beside the edge, over its contrast [1/px]
  double wider_px = 0.0;
  bool darker = false;  // the body than what is beside it
  double rise = 0.0;    // how fast the latter gets brighter farther out, over the contrast [1/px]
};

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

// What the model of an edge may be wrong by along a whole stretch of the outline [px]: how the
// light goes on under the blur, a sliver of shadow, levels beyond the range of the picture.
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

// By how much an edge is seen too far out beside the shadow of a body darker than the floor [px].
// Where the floor gets brighter farther out there is a penumbra, and between it and the rim what
// the lamp does not reach at all, narrower than the blur and about as dark as the body; near the
// contact the light of the room is missing too, unless the floor is as bright there as where it is
// brightest. The higher above the floor, the farther from the rim all that is. Sizes: means over
// recordings made by two ray tracers, edges about the true outline.
double shadow_px(const EdgeSurroundings& around, const ProfileEdge& edge, double height_px) {
  constexpr double kPerRisePx2 = 2.5, kMostPx = 0.6, kPenumbraHeightPx = 25.0;
  constexpr double kContactPx = 0.04, kContactHeightPx = 12.0, kContactDims = 0.03;
  if (!around.darker) return 0.0;
  return std::min(kMostPx, kPerRisePx2 * around.rise) * std::exp(-height_px / kPenumbraHeightPx) +
         kContactPx * std::min(1.0, edge.dimmed / kContactDims) *
             std::exp(-height_px / kContactHeightPx);
}

// What the sliver of a slightly rounded rim, too narrow to be seen apart, moves an edge by [px]: it
// mirrors the room and not what the face mirrors, on the side towards the light something else than
// on the far one (a rim without gloss does next to nothing). Taken as a share of the body's light;
// an edge of little contrast moves the most.
double sliver_px(const ProfileEdge& e) {
  constexpr double kSharePx = 0.04;  // a sliver of a third of a pixel, brighter by an eighth
  constexpr double kMostPx = 0.5;
  const double inner = e.mean_level - 0.5 * e.contrast;
  return std::min(kMostPx, kSharePx * std::max(inner, 0.0) / std::max(std::abs(e.contrast), 1.0));
}

// What edges of a whole side of the body may be wrong by alike [px]: light beside them that is not
// known by some share of it, and colours that luma mixes wrongly.
double common_light_px(const Scenery& scenery, const ProfileEdge& e, double blur_px) {
  constexpr double kUnknownPx = 0.03;    // beside an edge as strong as its mean level
  const double step_px = 2.5 * blur_px;  // of a Gaussian edge: shift per share of its step
  const double tone = tone_of(e);
  constexpr double kMostMixing = 0.3, kMixingShare = 0.85;  // the rest shading takes up
  const double mixing = scenery.tints
                            ? mixing_error(*scenery.tints, e.mean_level - 0.5 * e.contrast,
                                           e.mean_level + 0.5 * e.contrast)
                            : 0.0;
  return std::hypot(unknown_share(e) * kUnknownPx / (tone * std::sqrt(tone)),
                    kMixingShare * step_px * std::min(kMostMixing, std::abs(mixing)));
}

// Direction in the picture in which the outline of a pose is the narrowest.
double narrow_direction_rad(const data::Camera& camera, const data::Pose<>& pose) {
  const Eigen::Vector2d along =
      camera.jacobian_px_per_m(pose.centre_m) * axis_towards(camera, pose);
  return std::atan2(along.y(), along.x());
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

// An edge that is expected to be seen so much too far out; by how much really, differs along it.
void allow_for_shadow(double too_far_px, EdgeEquation& equation) {
  constexpr double kUnsureShare = 0.4;
  equation.offset_px -= too_far_px;
  equation.shadow_px = too_far_px;
  equation.model_px = std::hypot(equation.model_px, kUnsureShare * too_far_px);
}

// How much an edge off by this supports the pose, 0..1: an edge is certain at a gain of 3.
double certainty(const ProfileEdge& edge, double off_px, double tolerance_px) {
  constexpr double kCertain = 3.0;
  const double misfit =
      0.5 * off_px * off_px / (edge.lines * edge.noise_variance_px2 + tolerance_px * tolerance_px);
  return std::clamp((edge.gain - misfit) / kCertain, 0.0, 1.0);
}

// So much of the outline supports a fit by this edge of it.
double certain_px(const Refined& refined, size_t i) {
  constexpr double kTolerancePx = 0.1;
  const EdgeEquation& e = refined.equations[i];
  return e.arc_px * certainty(refined.edges[i], e.residual_px, kTolerancePx);
}

void keep(const OutlineSample& sample, const ProfileEdge& edge, const EdgeEquation& equation,
          Refined& out) {
  out.samples.push_back(sample);
  out.edges.push_back(edge);
  out.equations.push_back(equation);
}

constexpr double kSmoothPx = 2.0;  // closer samples of an outline are as well interpolated

// What one round looked at.
struct Round {
  std::vector<OutlineSample> outline;
  std::vector<OutlineSample> smooth;   // exact: what the outline interpolates
  std::vector<Crossings> crossings;    // exact: of the outline
  std::vector<Sweep> sweeps;           // during the exposure; empty: hardly any
  Moments moments;                     // of the exposure, of these
  std::vector<bool> elsewhere;         // of the outline: the rim, by its colours
  std::vector<StretchProfile> looks;   // exact: luma
  std::vector<size_t> places;          // of the looks along the outline
  std::vector<double> seen_in_colour;  // exact: 0..1, of the smooth outline

  [[nodiscard]] const Sweep* sweep(size_t i) const { return sweeps.empty() ? nullptr : &sweeps[i]; }
  // An edge of a shadow or a print may be here, the rim is not.
  [[nodiscard]] bool may_show_rim(size_t i) const { return elsewhere.empty() || !elsewhere[i]; }
};

// Edges of the silhouette, each by itself.
void collect_roughly(const Scenery& scenery, const Round& round, const Search& search, bool colour,
                     Refined& out) {
  const std::vector<OutlineSample>& all = round.outline;
  StretchProfile look;
  for (size_t i = 0; i < all.size(); ++i)
    if (all[i].silhouette && (colour || round.may_show_rim(i)) &&
        look_at(scenery, all[i], round.sweep(i), nullptr, search, colour, look) &&
        fit_edge(look.profile, look.blur_px, look.plate, look.reach_px, look.edge)) {
      keep(all[i], look.edge, equation_of(all[i], look.edge, colour), out);
      out.places.push_back(i);
    }
}

// All edges of the luma, also those between two surfaces of the body; returns what the blur should
// grow by. Light and blur of rounds before the last are not weighed by the noise of samples.
double collect_exactly(const Scenery& scenery, const Search& search, bool last, Round& round,
                       Refined& out) {
  const std::vector<OutlineSample>& all = round.outline;
  std::vector<StretchProfile>& looks = round.looks;
  std::vector<size_t>& places = round.places;
  places.clear();
  looks.resize(all.size());
  for (size_t i = 0; i < all.size(); ++i)
    if (round.may_show_rim(i) && look_at(scenery, all[i], round.sweep(i), &round.crossings[i],
                                         search, false, looks[places.size()]))
      places.push_back(i);
  looks.resize(places.size());
  static const ShadingMemory kNothing;
  StretchFit fit =
      fit_stretches(looks, scenery.shading != nullptr ? *scenery.shading : kNothing, last);
  const std::vector<EdgeSurroundings> around = edge_surroundings(looks);
  for (size_t i = 0; i < looks.size(); ++i) {
    if (!looks[i].found) continue;
    const OutlineSample& sample = all[places[i]];
    EdgeEquation equation = equation_of(sample, looks[i].edge, false);
    equation.offset_px -= rounded_by_blur_px(round.crossings[places[i]], search.blur_px);
    equation.model_px =
        model_sd_px(looks[i].edge, looks[i].profile.clipped(), around[i], sample.silhouette);
    if (sample.silhouette)
      allow_for_shadow(shadow_px(around[i], looks[i].edge, sample.height_px), equation);
    keep(sample, looks[i].edge, equation, out);
    out.shading.push_back(fit.shading[i]);
    out.blurs_px.push_back(looks[i].blur_px);
  }
  return fit.wider_px;
}

// One row of pixels of so many is looked at.
int rows_of_step(double step_px) {
  return std::max(1, static_cast<int>(std::lround(step_px)));
}

// What coding leaves of colours is off by half a level or so, alike for a few neighbours.
double coded_px(const ColourEdge& found) {
  constexpr double kOffLevels = 0.5, kMostPx = 1.0;
  const double step_px = std::sqrt(2.0 * data::kPi) * found.blur_px;
  return std::min(kMostPx, kOffLevels * step_px / std::max(1.0, std::abs(found.edge.contrast)));
}

// Those of the silhouette in the colour planes.
void collect_colours(const Scenery& scenery, const Search& search, double step_px, Round& round,
                     Refined& out) {
  const ExposedOutline outline{round.smooth, round.moments, scenery.smear};
  const double reach_px = search.reach_px + std::sqrt(kHalfSizeBlur2Px2);
  round.seen_in_colour.assign(round.smooth.size(), 0.0);
  for (const ColourEdge& found : find_colour_edges(scenery.colour, outline, search.blur_px,
                                                   reach_px, rows_of_step(step_px))) {
    const OutlineSample& sample = round.smooth[found.sample];
    EdgeEquation equation = equation_of(sample, found.edge, true);
    equation.motion = found.motion;
    equation.model_px = std::hypot(model_sd_px(found.edge, false, {}, true), coded_px(found));
    keep(sample, found.edge, equation, out);
    out.shading.emplace_back();
    out.blurs_px.push_back(found.blur_px);
    round.seen_in_colour[found.sample] = certainty(found.edge, found.edge.offset_px, kSeenWithinPx);
  }
}

// Sweeps longer than the blur are ramps; shorter ones only widen the edges.
void find_sweeps(const Scenery& scenery, const data::Pose<>& pose, Round& round) {
  constexpr double kLeastPx = 1.5, kPartPx = 1.2;
  round.sweeps.clear();
  round.moments.clear();
  if (!scenery.exposure) return;
  double longest = 0.0;
  for (const OutlineSample& sample : round.outline)
    longest = std::max(longest, std::abs(sample.motion.dot(scenery.smear)));
  if (longest < kLeastPx) return;
  const int parts = std::min(Sweep::kMost, static_cast<int>(std::ceil(longest / kPartPx)));
  round.moments =
      moments_of(scenery.body, scenery.camera, scenery.motion, *scenery.exposure, pose, parts);
  round.sweeps = sweeps_of(round.moments, round.outline);
}

// From the sparse outline to where it crosses rows and columns of pixels.
void cross_outline(double step_px, Round& round) {
  const int every = rows_of_step(step_px);
  round.outline = cross_pixels(round.outline, every, round.crossings);
  if (round.sweeps.empty()) return;
  std::vector<Sweep> sweeps;
  sweeps.reserve(round.crossings.size());
  for (const Crossings& c : round.crossings) {
    const Crossing& at = c.at.front();
    sweeps.push_back(between(round.sweeps[at.before], round.sweeps[at.before + 1], at.part));
  }
  round.sweeps = std::move(sweeps);
}

// The share of the body's colour at a distance from the outline, mean over a few pixels along it;
// as it should be where the picture ends.
double colour_at(const ColourWindow& colour, const OutlineSample& sample, double outwards_px) {
  constexpr std::array<double, 3> kAlongPx{-2.0, 0.0, 2.0};
  const Eigen::Vector2d along(-sample.normal_px.y(), sample.normal_px.x());
  double sum = 0.0;
  for (const double off : kAlongPx) {
    const Eigen::Vector2d p = sample.image_px + outwards_px * sample.normal_px + off * along;
    if (!colour.levels.holds(p)) return outwards_px < 0.0 ? 1.0 : 0.0;
    const Eigen::Vector2f at = p.cast<float>();
    sum += static_cast<double>(colour.levels.at(at.x(), at.y()));
  }
  return sum / (static_cast<double>(kAlongPx.size()) * colour.body);
}

// Whether the wall has the colour of the face, as far as it is wide enough to be seen.
bool wall_like_face(const ColourWindow& colour, const std::vector<OutlineSample>& outline) {
  constexpr double kWidePx = 4.0, kLeastShare = 0.5;
  std::vector<double> shares;
  for (const OutlineSample& sample : outline)
    if (sample.silhouette && sample.edge == Edge::lower_rim && sample.inside_px > kWidePx)
      shares.push_back(colour_at(colour, sample, -0.5 * sample.inside_px));
  return shares.empty() || data::median(std::move(shares)) > kLeastShare;
}

bool darker_within(const LightWindow& picture, const OutlineSample& sample, double off_px) {
  const Eigen::Vector2d inside = sample.image_px - off_px * sample.normal_px,
                        outside = sample.image_px + off_px * sample.normal_px;
  if (!picture.holds(inside) || !picture.holds(outside)) return false;
  const Eigen::Vector2f a = inside.cast<float>(), b = outside.cast<float>();
  return picture.at(a.x(), a.y()) < picture.at(b.x(), b.y());
}

// Where a silhouette would lie on the edge of the body's shadow (within, the floor's colour, darker
// than what is beside it), or on an edge of the body's own (beyond, the body's colour).
void find_rim_elsewhere(const Scenery& scenery, const Search& search, Round& round) {
  constexpr double kClearOfBlur = 1.8, kFloor = 0.4, kBody = 0.6;
  round.elsewhere.clear();
  const ColourWindow& colour = scenery.colour;
  if (colour.empty() || !colour.plain) return;
  const bool wall_alike = wall_like_face(colour, round.outline);
  const double clear_px =
      kClearOfBlur * std::sqrt(search.blur_px * search.blur_px + kColourBlur2Px2);
  round.elsewhere.resize(round.outline.size());
  for (size_t i = 0; i < round.outline.size(); ++i) {
    const OutlineSample& sample = round.outline[i];
    if (!sample.silhouette) continue;
    const Sweep* sweep = round.sweep(i);
    const double off_px = clear_px + (sweep != nullptr ? sweep->half_range_px() : 0.0);
    const bool told_within =
        sample.edge == Edge::lower_rim ? wall_alike : sample.inside_px >= clear_px;
    const bool on_shadow = told_within && colour_at(colour, sample, -off_px) < kFloor &&
                           darker_within(scenery.picture, sample, off_px);
    const bool on_body = sample.outside_px > off_px && colour_at(colour, sample, off_px) > kBody;
    round.elsewhere[i] = on_shadow || on_body;
  }
}

bool collect(const Scenery& scenery, const data::Pose<>& pose, const Search& search, bool last,
             Round& round, Refined& out) {
  const double step_px = last ? search.step_px : search.first_step_px;
  round.outline = outline_samples(scenery.body, pose, scenery.camera, scenery.motion,
                                  search.exact ? kSmoothPx : step_px);
  find_sweeps(scenery, pose, round);
  if (search.exact) {
    round.smooth = round.outline;
    cross_outline(step_px, round);
  }
  find_rim_elsewhere(scenery, search, round);
  out.outline_px = 0.0;
  for (const OutlineSample& sample : round.outline)
    if (sample.silhouette) out.outline_px += sample.arc_px;
  out.samples.clear();
  out.edges.clear();
  out.equations.clear();
  out.shading.clear();
  out.blurs_px.clear();
  out.places.clear();
  for (const bool colour : {false, true}) {
    if (colour && scenery.colour.empty()) continue;
    if (!search.exact) {
      collect_roughly(scenery, round, search, colour, out);
      continue;
    }
    if (colour)
      collect_colours(scenery, search, step_px, round, out);
    else
      out.wider_px = collect_exactly(scenery, search, last, round, out);
  }
  return !round.outline.empty();
}

// Length of the silhouette with an edge exactly there; a place seen in luma and in colour counts
// once, by the better of the two.
double seen_px(const Search& search, const Round& round, const Refined& refined) {
  std::vector<double> seen(round.outline.size(), 0.0);
  const auto count = [&](size_t place, const ProfileEdge& edge) {
    seen[place] = std::max(seen[place], certainty(edge, edge.offset_px, kSeenWithinPx));
  };
  if (!search.exact)
    for (size_t i = 0; i < refined.edges.size(); ++i) count(refined.places[i], refined.edges[i]);
  if (search.exact && !round.seen_in_colour.empty())
    for (size_t i = 0; i < seen.size(); ++i) {
      const Crossing& at = round.crossings[i].at.front();
      seen[i] = round.seen_in_colour[at.part < 0.5 ? at.before : at.before + 1];
    }
  // A plain step or nothing: slopes can make an edge of any penumbra.
  for (size_t i = 0; search.exact && i < round.places.size(); ++i) {
    const size_t place = round.places[i];
    const StretchProfile& look = round.looks[i];
    ProfileEdge plain;
    if (look.found && round.outline[place].silhouette && seen[place] < 1.0 &&
        fit_edge(look.profile, look.blur_px, look.plate, kSeenReachPx, plain))
      count(place, plain);
  }
  double sum = 0.0;
  for (size_t i = 0; i < seen.size(); ++i) sum += seen[i] * round.outline[i].arc_px;
  return sum;
}

PoseMotion::Step prior_of(const PoseMotion& motion) {
  PoseMotion::Step sd(motion.count());
  for (int i = 0; i < motion.count(); ++i) sd[i] = motion.scale(i);
  return sd;
}

}  // namespace

std::optional<Refined> refine(const Scenery& scenery, const data::Pose<>& start,
                              const Search& search) {
  Refined out;
  out.pose = start;
  const PoseMotion::Step prior = prior_of(scenery.motion);
  // Edges this share of the blur apart may belong together, whatever they claim.
  constexpr double kLeastScale = 0.15, kLeastExactScale = 0.05;
  const double least_scale_px = (search.exact ? kLeastExactScale : kLeastScale) * search.blur_px;
  Round round;
  bool last = search.first_step_px <= search.step_px;
  for (int i = 0; i < search.iterations; ++i) {
    if (!collect(scenery, out.pose, search, last, round, out)) return std::nullopt;
    if (!solve_robustly(out.equations, prior, least_scale_px, search.exact, out.solution))
      return std::nullopt;
    out.pose = scenery.motion.moved(out.pose, out.solution.step);
    double moved2 = 0.0;
    for (const auto& e : out.equations) moved2 += std::pow(e.motion.dot(out.solution.step), 2);
    const double settled2 =
        search.settled_px * search.settled_px * static_cast<double>(out.equations.size());
    const bool settled = moved2 < settled2;
    // Linear sums about a predicted edge bear a small step at most, a last look hardly any.
    constexpr double kLinear = 2.5;
    if (last && (settled || (search.exact && scenery.visit != Visit::again &&
                             moved2 < kLinear * kLinear * settled2)))
      break;
    last = last || settled || i + 2 >= search.iterations;
  }
  out.seen_px = seen_px(search, round, out);
  double accepted_px = 0.0;
  for (size_t i = 0; i < out.equations.size(); ++i)
    if (out.samples[i].silhouette && out.equations[i].weight > 0.5)
      accepted_px += out.samples[i].arc_px;
  const double channels = scenery.colour.empty() ? 1.0 : 2.0;
  out.covered = out.outline_px > 0.0 ? accepted_px / (channels * out.outline_px) : 0.0;
  return out;
}

// A lamp makes one side of the body wrong against the other; what the light is like beside the long
// sides of the outline and at its ends, where the wall turns away, differs by more.
void find_uncertainty(const Scenery& scenery, Refined& refined) {
  // By normalised errors of centre, tilt and precession in recordings made by two ray tracers.
  constexpr double kSides = 0.6, kFlanks = 1.5, kTwist = 0.75;
  const double narrow_rad = narrow_direction_rad(scenery.camera, refined.pose);
  for (size_t i = 0; i < refined.equations.size(); ++i) {
    EdgeEquation& e = refined.equations[i];
    const double light_px = common_light_px(scenery, refined.edges[i], refined.blurs_px[i]);
    e.common_px = std::hypot(kSides * light_px, sliver_px(refined.edges[i]));
    if (!refined.samples[i].silhouette) continue;
    e.flank_px = kFlanks * light_px * std::cos(2.0 * (e.direction_rad - narrow_rad));
    e.twist_px = kTwist * e.common_px * std::sin(2.0 * (e.direction_rad - narrow_rad));
  }
  find_uncertainty(refined.equations, prior_of(scenery.motion), refined.solution);
}

double accepted_of(const Refined& refined) {
  return refined.outline_px > 0.0 ? refined.seen_px / refined.outline_px : 0.0;
}

double larger_px(const Refined& refined) {
  double sum_px = 0.0, rim_px = 0.0;
  for (size_t i = 0; i < refined.equations.size(); ++i) {
    const EdgeEquation& e = refined.equations[i];
    if (e.weight < 0.5 || !refined.samples[i].silhouette || e.swell < 0.0 || e.colour) continue;
    sum_px += e.arc_px * (refined.solution.swell_px + e.polarity * refined.solution.polarity_px);
    rim_px += e.arc_px;
  }
  return rim_px > 0.0 ? sum_px / rim_px : 0.0;
}

double support_px_of(const Refined& refined) {
  // A residual of this size halves what an edge says, however clear it is, if it claims to be
  // exact.
  constexpr double kHalvesPx = 0.3;
  double support_px = 0.0;
  for (size_t i = 0; i < refined.edges.size(); ++i) {
    const EdgeEquation& e = refined.equations[i];
    const double off2 = e.residual_px * e.residual_px /
                        (kHalvesPx * kHalvesPx + e.variance_px2 + e.model_px * e.model_px);
    support_px += certain_px(refined, i) / (1.0 + off2);
  }
  // Told right from wrong readings of 20 recordings by logistic regression, half a pixel of size is
  // worth about a quarter of the edges.
  constexpr double kPerPx = 0.55, kMostPx = 0.45;
  return support_px * std::exp(-kPerPx * std::min(kMostPx, std::abs(larger_px(refined))));
}

double evenness_of(const Refined& refined) {
  // By logistic regression on 4983 pairs of a right and a wrong pose in one picture, from 61 of the
  // independent clips.
  constexpr double kPerPx2 = 5.0, kMostPx2 = 1.0;
  double sum_px3 = 0.0, luma_px = 0.0;
  for (size_t i = 0; i < refined.edges.size(); ++i) {
    if (refined.equations[i].colour) continue;
    const double certain = certain_px(refined, i);
    sum_px3 += certain * std::min(kMostPx2, refined.edges[i].shading_variance_px2);
    luma_px += certain;
  }
  return luma_px > 0.0 ? std::exp(-kPerPx2 * sum_px3 / luma_px) : 1.0;
}

}  // namespace trochoid::tracking
