#include "pose/outline_refine.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "edges/colour_edges.hpp"
#include "edges/colour_window.hpp"
#include "geometry/contour.hpp"
#include "pose/edge_equation.hpp"
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

// Direction in the picture in which the outline of a pose is the narrowest.
double narrow_direction_rad(const data::Camera& camera, const data::Pose<>& pose) {
  const Eigen::Vector2d along =
      camera.jacobian_px_per_m(pose.centre_m) * axis_towards(camera, pose);
  return std::atan2(along.y(), along.x());
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

// Edges of the silhouette and, in luma, of a border, each by itself.
void collect_roughly(const Scenery& scenery, const Round& round, const Search& search, bool colour,
                     Refined& out) {
  const std::vector<OutlineSample>& all = round.outline;
  StretchProfile look;
  for (size_t i = 0; i < all.size(); ++i)
    if ((colour ? all[i].silhouette : tells_outline(all[i])) && (colour || round.may_show_rim(i)) &&
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
  round.moments = moments_of(scenery.body, scenery.camera, scenery.motion, *scenery.exposure, pose,
                             parts, scenery.in_readout);
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
  read_in_turn(scenery.in_readout, scenery.camera.image_from_table<double>(pose.centre_m),
               round.outline);
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
// once, by the better of the two, and a border on the face may stand in for the rim.
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
    if (look.found && tells_outline(round.outline[place]) && seen[place] < 1.0 &&
        fit_edge(look.profile, look.blur_px, look.plate, kSeenReachPx, plain))
      count(place, plain);
  }
  double sum = 0.0;
  for (size_t i = 0; i < seen.size(); ++i) sum += seen[i] * round.outline[i].arc_px;
  return std::min(sum, refined.outline_px);
}

data::PoseMotion::Step prior_of(const data::PoseMotion& motion) {
  data::PoseMotion::Step sd(motion.count());
  for (int i = 0; i < motion.count(); ++i) sd[i] = motion.scale(i);
  return sd;
}

}  // namespace

std::optional<Refined> refine(const Scenery& scenery, const data::Pose<>& start,
                              const Search& search) {
  Refined out;
  out.pose = start;
  const data::PoseMotion::Step prior = prior_of(scenery.motion);
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
    if (tells_outline(out.samples[i]) && out.equations[i].weight > 0.5)
      accepted_px += out.samples[i].arc_px;
  const double channels = scenery.colour.empty() ? 1.0 : 2.0;
  out.covered =
      out.outline_px > 0.0 ? std::min(1.0, accepted_px / (channels * out.outline_px)) : 0.0;
  return out;
}

// A lamp makes one side of the body wrong against the other; what the light is like beside the long
// sides of the outline and at its ends, where the wall turns away, differs by more.
void find_uncertainty(const Scenery& scenery, Refined& refined) {
  // By normalised errors of centre, tilt and precession in recordings made by two ray tracers.
  constexpr double kSides = 0.6, kFlanks = 1.5, kTwist = 0.75;
  const double narrow_rad = narrow_direction_rad(scenery.camera, refined.pose);
  const Eigen::Vector2d centre_px = scenery.camera.image_from_table<double>(refined.pose.centre_m);
  for (size_t i = 0; i < refined.equations.size(); ++i) {
    EdgeEquation& e = refined.equations[i];
    e.from_centre_px = refined.samples[i].image_px - centre_px;
    const double light_px = common_light_px(scenery.tints, refined.edges[i], refined.blurs_px[i]);
    e.common_px = std::hypot(kSides * light_px, sliver_px(refined.edges[i]));
    if (!refined.samples[i].silhouette) continue;
    e.flank_px = kFlanks * light_px * std::cos(2.0 * (e.direction_rad - narrow_rad));
    e.twist_px = kTwist * e.common_px * std::sin(2.0 * (e.direction_rad - narrow_rad));
  }
  find_uncertainty(refined.equations, prior_of(scenery.motion),
                   !scenery.in_readout.frames_per_px.isZero(), refined.solution);
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
