#include "outline_refine.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace trochoid::tracking {
namespace {

using Edge = data::OutlinePoint::Edge;

constexpr double kLeastInsidePx = 1.5;  // less does not show the level beside the edge

// Blur of an edge with this normal: the picture's own and the path of the body during the exposure.
double blur_along(const Scenery& scenery, const Eigen::Vector2d& normal, double blur_px) {
  const double smear = normal.dot(scenery.smear_px);
  return std::sqrt(blur_px * blur_px + smear * smear / 12.0);
}

// How far a profile may go before the blur of the body's next edge shows.
double clear_of_next(double next_px, double extent_px, double blur_px) {
  constexpr double kClearOfBlur = 1.5;
  return std::min(extent_px, next_px - kClearOfBlur * std::min(blur_px, 1.0));
}

// What may be assumed of the levels beside an edge: constant; changing linearly (shading, soft
// shadows); constant with only the nearest pixels looked at, outside (a sliver of shadow) or on
// both sides (a chamfer or relief of the body).
enum Assumption { kFlat, kSloped, kClose, kTight, kAssumptions };

// The edge near a point of the outline under each assumption.
struct Look {
  std::array<ProfileEdge, kAssumptions> edges;
  std::array<bool, kAssumptions> found{};
  bool clipped = false;  ///< the picture is saturated beside the edge
  [[nodiscard]] bool any() const {
    return std::any_of(found.begin(), found.end(), [](bool f) { return f; });
  }
};

bool look_for_edge(const Scenery& scenery, const OutlineSample& sample, const Search& search,
                   Profile& profile, Look& look) {
  constexpr double kClosePx = 1.1;
  const double blur = blur_along(scenery, sample.normal_px, search.blur_px);
  const double widen = blur - search.blur_px;
  const double inside = clear_of_next(sample.inside_px, search.extent_px + widen, blur);
  const double outside = clear_of_next(sample.outside_px, search.extent_px + widen, blur);
  if (inside < kLeastInsidePx || outside < kLeastInsidePx) return false;
  static const LightWindow kNoPlate;
  const LightWindow& plate = sample.silhouette ? scenery.plate : kNoPlate;
  if (!sample_profile(scenery.picture, plate, sample.image_px, sample.normal_px, inside, outside,
                      profile))
    return false;
  look.clipped = profile.clipped();
  const double reach = std::min(search.reach_px + widen, std::min(inside, outside));
  EdgeModel model{blur, plate_explains(profile, 1.5 * blur), false};
  const auto fit = [&](Assumption as) {
    look.found[as] = fit_edge(profile, model, 0.0, reach, search.edge_iterations, look.edges[as]);
  };
  fit(kFlat);
  if (!search.slopes) return look.any();
  model.slopes = true;
  fit(kSloped);
  if (outside > kClosePx + 2.0 * blur) {
    model.slopes = false;
    profile.end_at(kClosePx + blur);
    fit(kClose);
  }
  if (inside > kClosePx + 2.0 * blur) {
    model.slopes = false;
    profile.end_at(kClosePx + blur);
    profile.begin_at(-kClosePx - blur);
    fit(kTight);
  }
  return look.any();
}

// Noise of a picture grows with its level in linear light like the slope of the transfer curve.
double transfer_slope2(const ProfileEdge& e) {
  const auto of_level = [](double level) {
    return std::pow(2.2, 2) * std::pow(std::clamp(level, 1.0, 255.0) / 255.0, 1.09);
  };
  return 0.5 * (of_level(e.inner) + of_level(e.inner + e.contrast));
}

// Sums over a stretch of the outline: a single profile has too few degrees of freedom to know its
// own noise.
struct Pool {
  double square = 0.0, freedom = 0.0, information = 0.0, count = 0.0;
  [[nodiscard]] double noise2() const { return std::max(square / std::max(freedom, 1.0), 0.05); }
};

using Pools = std::array<Pool, kAssumptions>;

std::vector<Pools> pool_neighbours(const std::vector<OutlineSample>& samples,
                                   const std::vector<Look>& looks) {
  constexpr int kNeighbours = 5;
  const int n = static_cast<int>(looks.size());
  std::vector<Pools> pools(looks.size());
  for (int i = 0; i < n; ++i)
    for (int j = std::max(0, i - kNeighbours); j <= std::min(n - 1, i + kNeighbours); ++j) {
      const Look& look = looks[static_cast<size_t>(j)];
      if (samples[static_cast<size_t>(j)].edge != samples[static_cast<size_t>(i)].edge) continue;
      for (int as = 0; as < kAssumptions; ++as) {
        if (!look.found[as]) continue;
        Pool& pool = pools[static_cast<size_t>(i)][as];
        pool.square += look.edges[as].square;
        pool.freedom += look.edges[as].freedom;
        pool.information += look.edges[as].information;
        pool.count += 1.0;
      }
    }
  return pools;
}

// Noise of the sensor [8-bit levels squared] from the quieter part of the outline.
double sensor_noise2(const std::vector<Look>& looks, const std::vector<Pools>& pools) {
  constexpr double kLeast = 0.3;  // quantisation and compression
  std::vector<double> relative;
  for (size_t i = 0; i < looks.size(); ++i) {
    const Assumption as = looks[i].found[kSloped] ? kSloped : kFlat;
    if (looks[i].found[as])
      relative.push_back(pools[i][as].noise2() / transfer_slope2(looks[i].edges[as]));
  }
  if (relative.empty()) return kLeast;
  const auto quartile = relative.begin() + static_cast<std::ptrdiff_t>(relative.size() / 4);
  std::nth_element(relative.begin(), quartile, relative.end());
  return std::max(*quartile, kLeast);
}

// What the edge model itself may be wrong by, as a variance of one edge: its shape, light that
// varies across the edge by a small share of its level, levels beyond the range of the picture.
double model_variance_px2(const ProfileEdge& edge, bool silhouette, double blur_px, bool clipped) {
  constexpr double kShapePx = 0.03, kOwnShapePx = 0.15, kLightShare = 0.05, kClippedPx = 0.2;
  const double level = std::max(edge.inner, edge.inner + edge.contrast);
  // An error of one contrast beside the edge moves its half level by about the width of the blur.
  const double light_px =
      kLightShare * level / std::max(std::abs(edge.contrast), 1e-3) * std::max(blur_px, 0.5);
  const double shape_px = silhouette ? kShapePx : kOwnShapePx;
  return shape_px * shape_px + light_px * light_px + (clipped ? kClippedPx * kClippedPx : 0.0);
}

// Chooses the assumption that leaves the most precise edge. Residuals beyond the noise of the
// sensor are structure the assumption does not have: a sliver of shadow, a highlight. Structure
// goes on along the outline and does not average out like noise: it counts as fully correlated over
// kStructurePx.
void choose_edges(const Search& search, const std::vector<OutlineSample>& samples,
                  const std::vector<Look>& looks, Refined& out) {
  constexpr double kStructurePx = 12.0;
  constexpr double kUsualScatter = 1.15;  // of pooled squared noise about its mean
  const std::vector<Pools> pools = pool_neighbours(samples, looks);
  const double sensor2 = sensor_noise2(looks, pools);
  const double correlated = std::max(1.0, kStructurePx / search.step_px);
  for (size_t i = 0; i < looks.size(); ++i) {
    int best = -1;
    double best_variance = std::numeric_limits<double>::infinity(), own_variance = 0.0, noise = 0.0;
    for (int as = 0; as < kAssumptions; ++as) {
      if (!looks[i].found[as]) continue;
      const Pool& pool = pools[i][as];
      const double excess2 = std::max(
          0.0, pool.noise2() - kUsualScatter * sensor2 * transfer_slope2(looks[i].edges[as]));
      const double per_information = pool.noise2() + (correlated - 1.0) * excess2;
      const double variance = per_information * pool.count / pool.information;
      if (variance >= best_variance) continue;
      best = as;
      best_variance = variance;
      own_variance = per_information / looks[i].edges[as].information;
      noise = std::sqrt(pool.noise2());
    }
    if (best < 0) continue;
    ProfileEdge edge = looks[i].edges[static_cast<size_t>(best)];
    edge.variance_px2 =
        own_variance + correlated * model_variance_px2(edge, samples[i].silhouette, search.blur_px,
                                                       looks[i].clipped);
    edge.noise = noise;
    out.samples.push_back(samples[i]);
    out.edges.push_back(edge);
  }
}

EdgeEquation equation_of(const OutlineSample& sample, const ProfileEdge& edge) {
  const bool bore = sample.edge == Edge::upper_bore || sample.edge == Edge::lower_bore;
  EdgeEquation e;
  e.motion = sample.motion.transpose();
  e.swell = bore ? -1.0 : 1.0;
  e.polarity = edge.contrast < 0.0 ? -1.0 : 1.0;
  e.offset_px = edge.offset_px;
  e.variance_px2 = edge.variance_px2;
  e.arc_px = sample.arc_px;
  e.curve = static_cast<int>(sample.edge);
  return e;
}

bool collect(const Scenery& scenery, const data::Pose<>& pose, const Search& search, Refined& out,
             double& outline_px) {
  const auto all =
      outline_samples(scenery.body, pose, scenery.camera, scenery.motion, search.step_px);
  std::vector<OutlineSample> samples;
  std::vector<Look> looks;
  outline_px = 0.0;
  Profile profile;
  for (const OutlineSample& sample : all) {
    if (!sample.silhouette && !search.own_edges) continue;
    if (sample.silhouette) outline_px += sample.arc_px;
    Look look;
    if (!look_for_edge(scenery, sample, search, profile, look)) continue;
    samples.push_back(sample);
    looks.push_back(look);
  }
  out.samples.clear();
  out.edges.clear();
  out.equations.clear();
  choose_edges(search, samples, looks, out);
  for (size_t i = 0; i < out.edges.size(); ++i)
    out.equations.push_back(equation_of(out.samples[i], out.edges[i]));
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
  out.covered = outline_px > 0.0 ? accepted_px / outline_px : 0.0;
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
    if (refined.equations[i].weight < 0.5 || !sample.silhouette || sample.inside_px < 4.0 ||
        std::abs(edge.contrast) < 5.0 * edge.noise)
      continue;
    if (!sample_profile(scenery.picture, scenery.plate, sample.image_px, sample.normal_px, 3.0, 3.0,
                        profile))
      continue;
    // The same profile for every blur: only the model differs.
    double least = std::numeric_limits<double>::infinity(), blur = 0.0;
    for (const double tried : kTried) {
      ProfileEdge fit;
      const EdgeModel model{blur_along(scenery, sample.normal_px, tried),
                            plate_explains(profile, 1.5 * tried), true};
      if (fit_edge(profile, model, refined.equations[i].offset_px, 2.0, 4, fit) &&
          fit.square < least)
        least = fit.square, blur = tried;
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
  Profile profile;
  for (const OutlineSample& sample :
       outline_samples(scenery.body, pose, scenery.camera, scenery.motion, search.step_px)) {
    if (!sample.silhouette) continue;
    Look look;
    arc += sample.arc_px;
    if (!look_for_edge(scenery, sample, search, profile, look)) continue;
    const ProfileEdge& edge = look.edges[kFlat];
    const double off2 = edge.offset_px * edge.offset_px;
    const double gain = edge.gain - 0.5 * off2 / (edge.variance_px2 + kTolerancePx * kTolerancePx);
    score += sample.arc_px * std::clamp(gain / kCertain, 0.0, 1.0);
  }
  return arc > 0.0 ? score / arc : 0.0;
}

double evidence_of(const Refined& refined) {
  constexpr double kCertain = 3.0, kTolerancePx = 0.1;
  double evidence = 0.0;
  for (size_t i = 0; i < refined.edges.size(); ++i) {
    const ProfileEdge& edge = refined.edges[i];
    const EdgeEquation& e = refined.equations[i];
    const double variance = edge.noise * edge.noise / edge.information;
    const double misfit =
        0.5 * e.residual_px * e.residual_px / (variance + kTolerancePx * kTolerancePx);
    evidence += e.arc_px * std::max(0.0, std::min(edge.gain, kCertain) - misfit);
  }
  return evidence;
}

}  // namespace trochoid::tracking
