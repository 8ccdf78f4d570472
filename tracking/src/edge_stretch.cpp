#include "edge_stretch.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "normal_table.hpp"
#include "transfer_curve.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {
namespace {

constexpr double kLeastNoise2 = 0.05;  // [8-bit levels squared]

// Unknowns of the linear model: inner level, outer level and offset; slope inside and outside, bend
// inside and outside, by how much a strip at the edge differs from the rest of the body; blur.
constexpr int kOwn = 3, kAll = kOwn + kShading + 1;

using ShadingF = Eigen::Matrix<float, kShading, 1>;

// Of each sample: how much of it lies outside of an edge that sweeps and how fast that grows, and
// the same of a slope and a bend there. Shading goes along with the edge, as a shadow does: a slope
// taken for one that stays where it is would shift the edge by the sweep's square times the slope
// over twelve times the contrast.
struct Columns {
  using Samples = std::array<float, Profile::kMost>;
  Samples share, sloping, bending;
  Samples density, sloping_density, bending_density;
  Samples ground, strip;
  Samples gain;           // of the light, over the levels of the picture, in which noise is even
  float sharp_px = 1.0f;  // blur of each step
  float square = 0.0f;    // mean one of the steps' distances from the middle of the sweep [px^2]

  // Of unit slopes and bends inside and outside and of a strip.
  [[nodiscard]] ShadingF shading_columns(size_t k, float s) const {
    return {s - sloping[k], sloping[k] * ground[k], s * s + square - bending[k],
            bending[k] * ground[k], strip[k]};
  }
  // By how much more light comes as the blur grows [1/px], per contrast.
  [[nodiscard]] float widening(size_t k) const { return sloping_density[k] / sharp_px; }
};

// Sums of squared residuals and their degrees of freedom beside the edge, inside and outside, and
// on it: pixels that an edge crosses are noisier than either side (coding, sampling of the scene).
struct Noise {
  double light_square = 0.0;  // of all samples, in levels of light
  Eigen::Array3d square = Eigen::Array3d::Zero(), freedom = Eigen::Array3d::Zero();
};

using Variances = std::array<float, 3>;  // of a sample inside, outside and on the edge
constexpr Variances kEqual{1.0f, 1.0f, 1.0f};

// How a sample, of which such a share is outside, belongs to inside, outside and the edge.
Variances parts_of(float share) {
  const float off = 1.0f - 2.0f * share, beside = off * off * off * off, on = 1.0f - beside;
  return {beside * (1.0f - share), beside * share, on};
}

// Of a sample's light: noise of the picture's levels, of which it gives so many each.
float variance_at(const Variances& noise, float share, float gain) {
  const Variances part = parts_of(share);
  return gain * gain * (part[0] * noise[0] + part[1] * noise[1] + part[2] * noise[2]);
}

const std::array<float, 256>& gains_of_light() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> t{};
    for (size_t i = 0; i < t.size(); ++i)
      t[i] = static_cast<float>(light_per_level(static_cast<double>(i)));
    return t;
  }();
  return table;
}

void set_gain(const StretchProfile& p, float inner, float outer, Columns& c) {
  if (!p.curved) {
    std::fill_n(c.gain.begin(), p.profile.count, 1.0f);
    return;
  }
  const auto& table = gains_of_light();
  for (size_t k = 0; k < static_cast<size_t>(p.profile.count); ++k) {
    const float light = inner * (1.0f - c.share[k]) + outer * c.ground[k] * c.share[k];
    c.gain[k] = table[static_cast<size_t>(std::clamp(light, 0.0f, 255.0f))];
  }
}

// One profile with the sums over its model columns and what they say.
struct Working {
  bool usable = false;
  float inner = 0.0f, outer = 0.0f;                  // levels of the plain step
  std::array<std::array<float, kAll>, kAll> normal;  // lower triangle
  std::array<float, kAll> right;
  float square = 0.0f;
  // Of shading and blur with levels and offset free.
  ShadingMatrix shading_normal;
  Shading shading_right, blur_cross;
  double blur_normal = 0.0, blur_right = 0.0;
  double left_square = 0.0, freedom = 0.0;  // of all residuals, after fitting everything
  double light = 0.0;                       // brighter level
  Shading shading = Shading::Zero();
  ShadingMatrix shading_covariance = ShadingMatrix::Zero();
  double unevenness = 1.0;
  double blur_step = 0.0, blur_information = 0.0;
  Noise noise;
};

// The means over the steps of a profile at s: of the step, times the distance from it and times its
// square, and of the derivative by s alike.
struct Ramp {
  float share = 0.0f, sloping = 0.0f, bending = 0.0f;
  float density = 0.0f, sloping_density = 0.0f, bending_density = 0.0f;
};

Ramp ramp_at(const StretchProfile& p, float s) {
  const NormalTable& table = NormalTable::instance();
  Ramp ramp;
  const bool swept = p.steps > 0;
  const int count = swept ? p.steps : 1;
  const float part = 1.0f / static_cast<float>(count);
  const float inverse = 1.0f / static_cast<float>(swept ? p.sharp_px : p.blur_px);
  for (int k = 0; k < count; ++k) {
    const float off = swept ? s - p.step_at_px[static_cast<size_t>(k)] : s;
    const auto step = table.at(off * inverse);
    const float share = part * step.share, density = part * inverse * step.density;
    ramp.share += share, ramp.sloping += off * share, ramp.bending += off * off * share;
    ramp.density += density, ramp.sloping_density += off * density;
    ramp.bending_density += off * off * density;
  }
  return ramp;
}

void columns_of(const StretchProfile& p, Columns& c) {
  c.sharp_px = static_cast<float>(p.steps > 0 ? p.sharp_px : p.blur_px);
  c.square = 0.0f;
  for (int k = 0; k < p.steps; ++k) {
    const float at = p.step_at_px[static_cast<size_t>(k)];
    c.square += at * at / static_cast<float>(p.steps);
  }
  const auto strip = static_cast<float>(p.strip_px);
  float mean = 0.0f;
  for (int j = 0; j < p.profile.count; ++j) mean += p.profile.background[static_cast<size_t>(j)];
  // Of mean one, so that levels and slopes compare with those of neighbours without a plate.
  const float scale = p.plate ? static_cast<float>(p.profile.count) / std::max(mean, 1.0f) : 0.0f;
  for (int j = 0; j < p.profile.count; ++j) {
    const auto k = static_cast<size_t>(j);
    const Ramp ramp = ramp_at(p, p.profile.s_px[k]);
    c.share[k] = ramp.share, c.sloping[k] = ramp.sloping, c.bending[k] = ramp.bending;
    c.density[k] = ramp.density, c.sloping_density[k] = ramp.sloping_density;
    c.bending_density[k] = ramp.bending_density;
    c.strip[k] = p.strip_px > 0.0 ? ramp_at(p, p.profile.s_px[k] + strip).share - ramp.share : 0.0f;
    c.ground[k] = p.plate ? scale * p.profile.background[k] : 1.0f;
  }
}

bool plain_levels(const StretchProfile& p, const Columns& c, Working& w) {
  float aa = 0, ab = 0, bb = 0, ay = 0, by = 0;
  for (int j = 0; j < p.profile.count; ++j) {
    const auto k = static_cast<size_t>(j);
    const float a = 1.0f - c.share[k], b = c.share[k] * c.ground[k], y = p.profile.light[k];
    aa += a * a, ab += a * b, bb += b * b, ay += a * y, by += b * y;
  }
  const float determinant = aa * bb - ab * ab;
  if (!(determinant > 1e-3f * aa * bb)) return false;
  w.inner = (bb * ay - ab * by) / determinant;
  w.outer = (aa * by - ab * ay) / determinant;
  return true;
}

// Sums of all columns, samples weighed by their noise; the right side is what the plain step
// leaves.
void accumulate(const StretchProfile& p, const Columns& c, const Variances& noise, Working& w) {
  // Samples along the first index, so that the sums are dot products of whole vectors.
  Eigen::Matrix<float, Profile::kMost, kAll + 1> rows;
  const int count = p.profile.count, whole = (count + 3) / 4 * 4;
  for (int j = 0; j < count; ++j) {
    const auto k = static_cast<size_t>(j);
    const float s = p.profile.s_px[k], ground = c.ground[k];
    const float a = 1.0f - c.share[k], b = c.share[k] * ground;
    const float contrast = w.inner - w.outer * ground, d = contrast * c.density[k];
    rows(j, 0) = a, rows(j, 1) = b, rows(j, 2) = d;
    rows.row(j).segment<kShading>(kOwn) = c.shading_columns(k, s).transpose();
    rows(j, kAll - 1) = contrast * c.widening(k);
    rows(j, kAll) = p.profile.light[k] - w.inner * a - w.outer * b;
    rows.row(j) *= 1.0f / std::sqrt(variance_at(noise, c.share[k], c.gain[k]));
  }
  rows.middleRows(count, whole - count).setZero();
  const auto sum = [&](int m, int n) {
    return rows.col(m).head(whole).dot(rows.col(n).head(whole));
  };
  for (int m = 0; m < kAll; ++m) {
    for (int n = 0; n <= m; ++n)
      w.normal[static_cast<size_t>(m)][static_cast<size_t>(n)] = sum(m, n);
    w.right[static_cast<size_t>(m)] = sum(m, kAll);
  }
  w.square = sum(kAll, kAll);
}

// Largest slopes [per px] and bends [per px^2] of the light and difference of a strip, as shares of
// the light.
Shading largest_shading() {
  constexpr double kSlope = 0.06, kBend = 0.02, kStrip = 0.3;
  return (Shading() << kSlope, kSlope, kBend, kBend, kStrip).finished();
}

// Projects levels and offset out of the sums for shading and blur, and shading as large as it can
// be out of the square.
void reduce(const StretchProfile& p, Working& w) {
  std::array<std::array<double, kAll>, kAll> m{};
  std::array<double, kAll> r{};
  for (size_t i = 0; i < kAll; ++i) {
    for (size_t j = 0; j <= i; ++j) m[i][j] = static_cast<double>(w.normal[i][j]);
    r[i] = static_cast<double>(w.right[i]);
  }
  m[2][2] += 0.05;  // without contrast any offset fits; a few pixels are possible
  double square = static_cast<double>(w.square);
  const auto eliminate = [&](size_t k) {
    const double pivot = m[k][k];
    if (!(pivot > 1e-9)) return;
    square -= r[k] * r[k] / pivot;
    for (size_t i = k + 1; i < kAll; ++i) {
      const double factor = m[i][k] / pivot;
      r[i] -= factor * r[k];
      for (size_t j = k + 1; j <= i; ++j) m[i][j] -= factor * m[j][k];
    }
  };
  for (size_t k = 0; k < kOwn; ++k) eliminate(k);
  for (size_t i = 0; i < kShading; ++i) {
    const auto row = static_cast<int>(i);
    for (size_t j = 0; j <= i; ++j)
      w.shading_normal(row, static_cast<int>(j)) = w.shading_normal(static_cast<int>(j), row) =
          m[kOwn + i][kOwn + j];
    w.shading_right[row] = r[kOwn + i];
    w.blur_cross[row] = m[kAll - 1][kOwn + i];
  }
  w.blur_normal = m[kAll - 1][kAll - 1];
  w.blur_right = r[kAll - 1];
  constexpr double kLeastLight = 2.0;
  w.light = std::max({kLeastLight, std::abs(static_cast<double>(w.inner)),
                      std::abs(static_cast<double>(w.outer))});
  const Shading prior = (w.light * largest_shading()).cwiseAbs2().cwiseInverse();
  for (size_t k = kOwn; k < kOwn + kShading; ++k) {
    m[k][k] += prior[static_cast<int>(k) - kOwn];
    eliminate(k);
  }
  w.left_square = std::max(0.0, square);
  w.freedom = std::max(0.5, p.profile.count / p.profile.shared - 5.0);
}

// Sum of `of(look)` over the neighbours of each look within its curve.
template <class Sum, class Of>
std::vector<Sum> sums_of_neighbours(const std::vector<Working>& all,
                                    const std::vector<StretchProfile>& profiles,
                                    double share_of_curve, const Sum& none, const Of& of) {
  std::vector<Sum> out(all.size(), none), before;
  for (size_t first = 0, end = 0; first < all.size(); first = end) {
    before.assign(1, none);
    for (; end < all.size() && profiles[end].curve == profiles[first].curve; ++end) {
      before.push_back(before.back());
      if (all[end].usable) before.back() += of(end);
    }
    constexpr size_t kLeastReach = 4;
    const size_t count = end - first;
    const auto reach = std::max(
        kLeastReach, static_cast<size_t>(0.5 * share_of_curve * static_cast<double>(count)));
    for (size_t i = 0; i < count; ++i)
      out[first + i] = before[std::min(count, i + reach + 1)] - before[i - std::min(i, reach)];
  }
  return out;
}

// How noisy samples are is known from a stretch of the outline, not from a single look.
std::vector<double> noise_of_looks(const std::vector<StretchProfile>& profiles,
                                   const std::vector<Working>& all) {
  constexpr double kShare = 0.08;
  const auto sums = sums_of_neighbours(
      all, profiles, kShare, Eigen::Array2d(0.0, 0.0),
      [&](size_t i) { return Eigen::Array2d(all[i].left_square, all[i].freedom); });
  std::vector<double> noise2(all.size());
  for (size_t i = 0; i < all.size(); ++i)
    noise2[i] = profiles[i].profile.shared * kLeastNoise2 + sums[i][0] / std::max(sums[i][1], 1e-3);
  return noise2;
}

std::vector<ShadingEvidence> shading_evidence(const std::vector<StretchProfile>& profiles,
                                              const std::vector<double>& noise2,
                                              const std::vector<Working>& all) {
  std::vector<ShadingEvidence> evidence(all.size());
  for (size_t i = 0; i < all.size(); ++i) {
    const Working& w = all[i];
    ShadingEvidence& e = evidence[i];
    e.usable = w.usable;
    e.curve = profiles[i].curve;
    e.direction_rad = profiles[i].direction_rad;
    if (!w.usable) continue;
    const Shading unit = w.light * largest_shading();
    e.normal = unit.asDiagonal() * w.shading_normal * unit.asDiagonal() / noise2[i];
    e.right = unit.cwiseProduct(w.shading_right) / noise2[i];
  }
  return evidence;
}

// In levels, and the blur with this shading.
void set_shading(const ShadingEstimate& estimate, double noise2, Working& w) {
  const Shading unit = w.light * largest_shading();
  w.shading = unit.cwiseProduct(estimate.shading);
  w.unevenness = estimate.unevenness;
  w.shading_covariance = unit.asDiagonal() * estimate.covariance * unit.asDiagonal();
  w.blur_information = w.blur_normal / noise2 -
                       (w.blur_cross / noise2).dot(w.shading_covariance * w.blur_cross / noise2);
  w.blur_step = w.blur_information > 0.0
                    ? (w.blur_right - w.blur_cross.dot(w.shading)) / noise2 / w.blur_information
                    : 0.0;
}

// By how much the edges should be wider: the median, so that shadows that end beside some of them
// do not count.
double blur_step(const std::vector<Working>& all) {
  constexpr size_t kFewest = 8;
  constexpr double kLeastInformation = 30.0, kMost = 0.3;
  std::vector<double> steps;
  for (const Working& w : all)
    if (w.usable && w.blur_information > kLeastInformation)
      steps.push_back(std::clamp(w.blur_step, -kMost, kMost));
  if (steps.size() < kFewest) return 0.0;
  return data::upper_median(std::move(steps));
}

// Makes the edges of all looks wider.
void widen(double step, std::vector<Working>& all) {
  for (Working& w : all) {
    if (!w.usable) continue;
    w.shading_right -= step * w.blur_cross;
    w.blur_right -= step * w.blur_normal;
  }
}

// Shading beside the edges and their common blur, which explains what it can first: a picture less
// sharp than expected looks as if it were brighter and darker beside every edge.
StretchFit find_shadings(const std::vector<StretchProfile>& profiles,
                         const std::vector<double>& noise2, const ShadingMemory& known,
                         std::vector<Working>& all) {
  constexpr double kLittle = 0.02;  // of the largest variance
  constexpr int kRounds = 3;
  StretchFit out;
  for (int round = 0; round < kRounds; ++round) {
    out.shading = shading_evidence(profiles, noise2, all);
    const std::vector<ShadingEstimate> estimates =
        round == 0 ? shadings_given(out.shading, kLittle) : estimate_shadings(out.shading, known);
    for (size_t i = 0; i < all.size(); ++i)
      if (all[i].usable) set_shading(estimates[i], noise2[i], all[i]);
    const double step = blur_step(all);
    out.wider_px += step;
    if (round + 1 < kRounds) widen(step, all);
  }
  return out;
}

// The level beside the edge at a distance from it.
float shaded(float level, float slope, float bend, float s) {
  return level + s * (slope + s * bend);
}

// Squared residuals beside and on the edge about the best step with this shading, whose levels it
// keeps, and the degrees of freedom that the fit has left them.
void find_noise(const StretchProfile& p, const Columns& c, const Variances& assumed, double noise2,
                Working& w) {
  Eigen::Matrix3d m;
  Eigen::Vector3d r;
  for (int i = 0; i < kOwn; ++i) {
    const auto row = static_cast<size_t>(i);
    for (int j = 0; j <= i; ++j)
      m(i, j) = m(j, i) = static_cast<double>(w.normal[row][static_cast<size_t>(j)]);
    r[i] = static_cast<double>(w.right[row]);
    for (int k = 0; k < kShading; ++k)
      r[i] -= static_cast<double>(w.normal[static_cast<size_t>(kOwn + k)][row]) * w.shading[k];
  }
  m(2, 2) += 1.0;
  const Eigen::Matrix3d inverse = m.inverse();
  const Eigen::Vector3f own = (inverse * r).cast<float>();
  const Eigen::Matrix3f leverage = inverse.cast<float>();
  const ShadingF v = w.shading.cast<float>();
  const float inner = w.inner + own[0], outer = w.outer + own[1];
  const double own_share = 1.0 / p.profile.shared;
  w.noise = {};
  for (int j = 0; j < p.profile.count; ++j) {
    const auto k = static_cast<size_t>(j);
    const float s = p.profile.s_px[k], a = 1.0f - c.share[k], b = c.share[k] * c.ground[k];
    const float d = (w.inner - w.outer * c.ground[k]) * c.density[k];
    const float rest =
        p.profile.light[k] - inner * a - outer * b - c.shading_columns(k, s).dot(v) - own[2] * d;
    const Eigen::Vector3f row(a, b, d);
    const double free =
        own_share -
        static_cast<double>(row.dot(leverage * row) / variance_at(assumed, c.share[k], c.gain[k]));
    const Variances part = parts_of(c.share[k]);
    const Eigen::Array3d parts(part[0], part[1], part[2]);
    const float levels = rest / c.gain[k];
    w.noise.light_square += own_share * static_cast<double>(rest * rest);
    w.noise.square += own_share * static_cast<double>(levels * levels) * parts;
    w.noise.freedom += free * parts;
  }
  w.inner = inner, w.outer = outer;
  // Of the shading the share that the samples determine and not what is known of it beforehand;
  // it comes from either side of the edge.
  const double shading = w.shading_covariance.cwiseProduct(w.shading_normal).sum() / noise2;
  constexpr double kLeastFreedom = 0.2;
  w.noise.freedom -= Eigen::Array3d(0.5, 0.5, 0.0) * shading;
  w.noise.freedom = w.noise.freedom.max(kLeastFreedom);
}

// Variances of a sample from a stretch of the outline.
std::vector<Variances> noise_of_neighbours(const std::vector<Working>& all,
                                           const std::vector<StretchProfile>& profiles) {
  constexpr double kShare = 0.07;
  const auto square =
      sums_of_neighbours(all, profiles, kShare, Eigen::Array3d(Eigen::Array3d::Zero()),
                         [&](size_t i) { return all[i].noise.square; });
  const auto freedom =
      sums_of_neighbours(all, profiles, kShare, Eigen::Array3d(Eigen::Array3d::Zero()),
                         [&](size_t i) { return all[i].noise.freedom; });
  std::vector<Variances> out(all.size());
  for (size_t i = 0; i < all.size(); ++i)
    for (int k = 0; k < 3; ++k)
      out[i][static_cast<size_t>(k)] =
          static_cast<float>(profiles[i].profile.shared *
                             std::max(square[i][k] / std::max(freedom[i][k], 1e-3), kLeastNoise2));
  return out;
}

// The light beside an edge that was found, and how much speaks for it.
void describe_edge(StretchProfile& p, const Columns& c, const Working& w, float beside) {
  ProfileEdge& e = p.edge;
  const ShadingF v = w.shading.cast<float>();
  const auto s = static_cast<float>(e.offset_px);
  const float ground = c.ground[p.profile.nearest(e.offset_px)];
  const double inner = shaded(w.inner, v[0], v[2], s) + beside;
  e.contrast = shaded(w.outer, v[1], v[3], s) * ground - inner;
  e.mean_level = inner + 0.5 * e.contrast;
  e.inner_slope = v[0] + 2.0f * s * v[2];
  e.outer_slope = (v[1] + 2.0f * s * v[3]) * ground;
  const double square = w.noise.light_square;
  const double freedom = std::max(1.0, w.noise.freedom.sum());
  constexpr double kLeastGainNoise2 = 0.1;
  e.lines = p.profile.lines;
  e.gain = 0.5 * freedom / p.profile.lines *
           std::log((square_without_edge(p.profile, p.plate) / p.profile.shared +
                     freedom * kLeastGainNoise2) /
                    (square + freedom * kLeastGainNoise2));
}

// The offset with slopes given, samples weighed by their noise.
void fit_offset(StretchProfile& p, const Columns& c, const Variances& noise, const Working& w) {
  const ShadingF v = w.shading.cast<float>();
  const float beside = p.strip_px > 0.0 ? v[4] : 0.0f;  // of the edge the strip's level counts
  // a, b, d and the residual, the first three with their weights beside; then the shading.
  Eigen::Matrix<float, Profile::kMost, 4 + kOwn + kShading> rows;
  const int count = p.profile.count, whole = (count + 3) / 4 * 4;
  for (int j = 0; j < count; ++j) {
    const auto k = static_cast<size_t>(j);
    const float s = p.profile.s_px[k], ground = c.ground[k], share = c.share[k];
    const float a = 1.0f - share, b = share * ground;
    const float weight = 1.0f / variance_at(noise, share, c.gain[k]);
    const float d = (w.inner + beside - w.outer * ground) * c.density[k] +
                    (v[0] - v[1] * ground) * c.sloping_density[k] +
                    (v[2] - v[3] * ground) * c.bending_density[k];
    rows(j, 0) = a, rows(j, 1) = b, rows(j, 2) = d;
    rows(j, 3) = p.profile.light[k] - w.inner * a - w.outer * b - c.shading_columns(k, s).dot(v);
    rows(j, 4) = weight * a, rows(j, 5) = weight * b, rows(j, 6) = weight * d;
    rows.row(j).tail<kShading>() = c.shading_columns(k, s).transpose();
  }
  rows.middleRows(count, whole - count).setZero();
  const auto sum = [&](int m, int l) {
    return rows.col(m).head(whole).dot(rows.col(l).head(whole));
  };
  // Lower triangle of a, b, d; their right side; the shading they go with.
  const std::array<float, 6> n{sum(4, 0), sum(5, 0), sum(5, 1), sum(6, 0), sum(6, 1), sum(6, 2)};
  const std::array<float, kOwn> r{sum(4, 3), sum(5, 3), sum(6, 3)};
  const float determinant = n[0] * n[2] - n[1] * n[1];
  p.found = false;
  if (!(determinant > 1e-4f * n[0] * n[2])) return;
  // d with the levels projected out.
  const float in = (n[2] * n[3] - n[1] * n[4]) / determinant;
  const float out = (n[0] * n[4] - n[1] * n[3]) / determinant;
  const float information = n[5] - in * n[3] - out * n[4];
  if (!(information > 1e-4f)) return;
  const double offset = (r[2] - in * r[0] - out * r[1]) / information;
  if (!(std::abs(offset) <= p.reach_px)) return;
  Shading pull;
  for (int l = 0; l < kShading; ++l)
    pull[l] = (sum(6, 7 + l) - in * sum(4, 7 + l) - out * sum(5, 7 + l)) / information;
  ProfileEdge& e = p.edge;
  e.offset_px = offset;
  e.noise_variance_px2 = 1.0 / static_cast<double>(information);
  e.shading_variance_px2 = pull.dot(w.shading_covariance * pull);
  e.unevenness = w.unevenness;
  constexpr int kStrip = kShading - 1;
  const double strip_prior2 = std::pow(w.light * largest_shading()[kStrip], 2);
  e.strip_variance_px2 =
      std::pow(pull[kStrip] * w.shading_covariance(kStrip, kStrip), 2) / strip_prior2;
  describe_edge(p, c, w, beside);
  p.found = true;
}

}  // namespace

StretchFit fit_stretches(std::vector<StretchProfile>& profiles, const ShadingMemory& known,
                         bool weighed) {
  std::vector<Working> all(profiles.size());
  // A megabyte: kept, not cleared and given back with every look at a picture.
  thread_local std::vector<Columns> columns;
  if (columns.size() < profiles.size()) columns.resize(profiles.size());
  for (size_t i = 0; i < profiles.size(); ++i) {
    columns_of(profiles[i], columns[i]);
    all[i].usable = plain_levels(profiles[i], columns[i], all[i]);
    if (!all[i].usable) continue;
    set_gain(profiles[i], all[i].inner, all[i].outer, columns[i]);
    accumulate(profiles[i], columns[i], kEqual, all[i]);
    reduce(profiles[i], all[i]);
  }
  const std::vector<double> noise2 = noise_of_looks(profiles, all);
  StretchFit out = find_shadings(profiles, noise2, known, all);
  for (size_t i = 0; i < profiles.size(); ++i)
    if (all[i].usable) find_noise(profiles[i], columns[i], kEqual, noise2[i], all[i]);
  std::vector<Variances> noise = noise_of_neighbours(all, profiles);
  if (weighed) {
    for (size_t i = 0; i < profiles.size(); ++i) {
      if (!all[i].usable) continue;
      accumulate(profiles[i], columns[i], noise[i], all[i]);
      reduce(profiles[i], all[i]);
    }
    out = find_shadings(profiles, std::vector<double>(all.size(), 1.0), known, all);
    for (size_t i = 0; i < profiles.size(); ++i)
      if (all[i].usable) find_noise(profiles[i], columns[i], noise[i], 1.0, all[i]);
    noise = noise_of_neighbours(all, profiles);
  }
  for (size_t i = 0; i < profiles.size(); ++i) {
    profiles[i].found = false;
    if (all[i].usable) fit_offset(profiles[i], columns[i], noise[i], all[i]);
  }
  const double usual = blur_step(all);
  for (size_t i = 0; i < profiles.size(); ++i) {
    constexpr double kScatter_px = 0.1;
    const double variance = 1.0 / std::max(all[i].blur_information, 1e-9);
    const double seen = 1.0 / (1.0 + variance / (kScatter_px * kScatter_px));
    profiles[i].edge.wider_px = seen * (all[i].blur_step - usual);
    profiles[i].edge.wider_variance_px2 = seen * seen * variance;
  }
  return out;
}

}  // namespace trochoid::tracking
