#pragma once
#include "edges/stretch_kernel.hpp"

/// Included once per instruction set, with TROCHOID_STRETCH_ISA as the name of the kernel.
namespace trochoid::tracking::stretch {
namespace {

#define TROCHOID_INLINE __attribute__((always_inline)) inline

TROCHOID_INLINE Doubles wide(Floats x) {
  return __builtin_convertvector(x, Doubles);
}
TROCHOID_INLINE Floats narrow(Doubles x) {
  return __builtin_convertvector(x, Floats);
}
TROCHOID_INLINE Floats larger(Floats a, Floats b) {
  return a > b ? a : b;
}
TROCHOID_INLINE Floats smaller(Floats a, Floats b) {
  return a < b ? a : b;
}
TROCHOID_INLINE Doubles larger(Doubles a, Doubles b) {
  return a > b ? a : b;
}

// The normal distribution, as NormalTable has it.
struct Step {
  Floats share, density;
};
TROCHOID_INLINE Step normal_at(const float* table, Floats x) {
  constexpr float kRange = 4.0f, kPerUnit = 64.0f;
  const Floats zero = {};
  const Floats place = (smaller(larger(x, zero - kRange), zero + kRange) + kRange) * kPerUnit;
  const Masks i = __builtin_convertvector(place, Masks);
  const Floats part = place - __builtin_convertvector(i, Floats);
  Floats share, density, next_share, next_density;
  for (int l = 0; l < kLanes; ++l) {
    const float* entry = table + 2 * i[l];
    share[l] = entry[0], density[l] = entry[1];
    next_share[l] = entry[2], next_density[l] = entry[3];
  }
  return {share + part * (next_share - share), density + part * (next_density - density)};
}

// How a sample, of which such a share is outside, belongs to inside, outside and the edge.
TROCHOID_INLINE void parts_of(Floats share, Floats parts[3]) {
  const Floats off = 1.0f - 2.0f * share, square = off * off, beside = square * square;
  parts[0] = beside * (1.0f - share), parts[1] = beside * share, parts[2] = 1.0f - beside;
}

// Of a sample's light: noise of the picture's levels, of which it gives so many each.
TROCHOID_INLINE Floats variance_of(const Variances& noise, const Floats parts[3], Floats gain) {
  return gain * gain *
         (parts[0] * noise.part[0] + parts[1] * noise.part[1] + parts[2] * noise.part[2]);
}

// Four values, which memory may hold anywhere.
using Quad = double __attribute__((vector_size(32)));
using FloatQuad = float __attribute__((vector_size(16)));
template <class Four, class Value>
TROCHOID_INLINE Four loaded(const Value* from) {
  Four q;
  __builtin_memcpy(&q, from, sizeof q);
  return q;
}

template <class Four>
TROCHOID_INLINE void transpose(Four* q) {
  const Four a = __builtin_shufflevector(q[0], q[1], 0, 4, 2, 6),
             b = __builtin_shufflevector(q[0], q[1], 1, 5, 3, 7),
             c = __builtin_shufflevector(q[2], q[3], 0, 4, 2, 6),
             d = __builtin_shufflevector(q[2], q[3], 1, 5, 3, 7);
  q[0] = __builtin_shufflevector(a, c, 0, 1, 4, 5);
  q[1] = __builtin_shufflevector(b, d, 0, 1, 4, 5);
  q[2] = __builtin_shufflevector(a, c, 2, 3, 6, 7);
  q[3] = __builtin_shufflevector(b, d, 2, 3, 6, 7);
}

// Samples k .. k + 3 of every look.
TROCHOID_INLINE void four_samples(const float* const* looks, int k, Floats* out) {
  FloatQuad low[4], high[4];
  for (int l = 0; l < 4; ++l) {
    low[l] = loaded<FloatQuad>(looks[l] + k);
    high[l] = loaded<FloatQuad>(looks[4 + l] + k);
  }
  transpose(low), transpose(high);
  for (int i = 0; i < 4; ++i)
    out[i] = __builtin_shufflevector(low[i], high[i], 0, 1, 2, 3, 4, 5, 6, 7);
}

void put_side_by_side(const Lanes& lanes, int samples, Sample* out) {
  const Floats zero = {}, one = zero + 1.0f;
  for (int k = 0; k < samples; k += 4) {
    Floats s_px[4], light[4], ground[4];
    four_samples(lanes.s_px, k, s_px);
    four_samples(lanes.light, k, light);
    four_samples(lanes.ground, k, ground);
    for (int i = 0; i < (samples - k < 4 ? samples - k : 4); ++i) {
      const Masks there = lanes.count > k + i;
      Sample& sample = out[k + i];
      sample.s_px = there ? s_px[i] : zero;
      sample.light = there ? light[i] : zero;
      const Floats scaled = lanes.per_ground > zero ? lanes.per_ground * ground[i] : one;
      sample.ground = there ? scaled : zero;
      sample.valid = there ? one : zero;
    }
  }
}

void find_columns(Block& b, Sample* samples, const Tables& tables) {
  const Floats zero = {}, inverse = 1.0f / b.sharp_px;
  bool strips = false, curved = false;
  for (int l = 0; l < kLanes; ++l) strips = strips || b.strip_px[l] > 0.0f;
  for (int l = 0; l < kLanes; ++l) curved = curved || b.curved[l] > 0.0f;
  Floats square = zero;
  for (int j = 0; j < b.steps; ++j) square += b.step_part[j] * b.step_at_px[j] * b.step_at_px[j];
  Floats aa = zero, ab = zero, bb = zero, ay = zero, by = zero;
  for (int k = 0; k < b.samples; ++k) {
    Sample& c = samples[k];
    const Floats s = c.s_px, ground = c.ground;
    Floats share = zero, sloping = zero, bending = zero;
    Floats density = zero, sloping_density = zero, bending_density = zero;
    Floats beyond = zero, strip_density = zero, sloping_strip_density = zero;
    for (int j = 0; j < b.steps; ++j) {
      const Floats off = s - b.step_at_px[j], part = b.step_part[j] * c.valid;
      const Step step = normal_at(tables.normal, off * inverse);
      const Floats of_share = part * step.share, of_density = part * inverse * step.density;
      share += of_share, sloping += off * of_share, bending += off * off * of_share;
      density += of_density, sloping_density += off * of_density;
      bending_density += off * off * of_density;
      if (!strips) continue;
      const Floats within = off + b.strip_px;
      const Step inner = normal_at(tables.normal, within * inverse);
      beyond += part * inner.share;
      strip_density += part * inverse * inner.density;
      sloping_strip_density += within * part * inverse * inner.density;
    }
    c.share = share;
    c.inside = c.valid - share, c.outside = share * ground;
    c.density = density, c.sloping_density = sloping_density, c.bending_density = bending_density;
    c.strip_density = strip_density, c.sloping_strip_density = sloping_strip_density;
    c.shading[0] = s - sloping, c.shading[1] = sloping * ground;
    c.shading[2] = (s * s + square) * c.valid - bending, c.shading[3] = bending * ground;
    c.shading[4] = b.strip_px > zero ? beyond - share : zero;
    aa += c.inside * c.inside, ab += c.inside * c.outside, bb += c.outside * c.outside;
    ay += c.inside * c.light, by += c.outside * c.light;
  }
  const Floats determinant = aa * bb - ab * ab;
  b.usable = determinant > 1e-3f * aa * bb;
  b.inner = b.usable ? (bb * ay - ab * by) / determinant : zero;
  b.outer = b.usable ? (aa * by - ab * ay) / determinant : zero;
  for (int k = 0; k < b.samples; ++k) {
    Sample& c = samples[k];
    c.gain = zero + 1.0f;
    if (!curved) continue;
    const Floats light =
        smaller(larger(b.inner * c.inside + b.outer * c.outside, zero), zero + 255.0f);
    const Masks place = __builtin_convertvector(light, Masks);
    Floats gain;
    for (int l = 0; l < kLanes; ++l) gain[l] = tables.gain[place[l]];
    c.gain = b.curved * c.valid > zero ? gain : c.gain;
  }
}

// How fast a sample's light grows with the offset, levels being as they are beside plain steps.
TROCHOID_INLINE Floats change_with_offset(const Block& b, const Sample& c) {
  return (b.inner + b.strip - b.outer * c.ground) * c.density - b.strip * c.strip_density;
}

// The columns of the model, then the residual of the plain step; with their weights beside.
struct WeighedRow {
  Floats value[kAll + 1], weighed[kAll + 1];
};

template <int M>
TROCHOID_INLINE void sum_row(const WeighedRow* rows, int count, Floats* out) {
  Floats sums[M + 1] = {};
  for (int k = 0; k < count; ++k) {
    const Floats w = rows[k].weighed[M];
#pragma GCC unroll 16
    for (int n = 0; n <= M; ++n) sums[n] += w * rows[k].value[n];
  }
#pragma GCC unroll 16
  for (int n = 0; n <= M; ++n) out[n] = sums[n];
}

// Takes unknown k out of the equations of those after it, up to `end`.
TROCHOID_INLINE void eliminate(int k, int end, Doubles* m, Doubles* r, Doubles& square) {
  const Doubles zero = {};
  const Doubles pivot = m[at(k, k)];
  const Doubles inverse = pivot > 1e-9 ? 1.0 / pivot : zero;
  square -= r[k] * r[k] * inverse;
  for (int i = k + 1; i < end; ++i) {
    const Doubles factor = m[at(i, k)] * inverse;
    r[i] -= factor * r[k];
    for (int j = k + 1; j <= i; ++j) m[at(i, j)] -= factor * m[at(j, k)];
  }
}

void reduce(Block& b, Floats square_sum, const double* largest) {
  Doubles m[at(kAll, 0)], r[kAll], square = wide(square_sum);
  for (int i = 0; i < at(kAll, 0); ++i) m[i] = wide(b.normal[i]);
  for (int i = 0; i < kAll; ++i) r[i] = wide(b.right[i]);
  m[at(2, 2)] += 0.05;  // without contrast any offset fits; a few pixels are possible
  for (int k = 0; k < kOwn; ++k) eliminate(k, kAll, m, r, square);
  for (int i = 0; i < kShading; ++i) {
    for (int j = 0; j <= i; ++j) b.shading_normal[at(i, j)] = m[at(kOwn + i, kOwn + j)];
    b.shading_right[i] = r[kOwn + i];
    b.blur_cross[i] = m[at(kAll - 1, kOwn + i)];
  }
  b.blur_normal = m[at(kAll - 1, kAll - 1)];
  b.blur_right = r[kAll - 1];
  const Doubles zero = {}, least_light = zero + 2.0;
  const Doubles inner = wide(b.inner), outer = wide(b.outer);
  b.light = larger(least_light, larger(larger(inner, -inner), larger(outer, -outer)));
  constexpr double kLeastOfLight = 0.05;
  b.body = larger(larger(inner, -inner), kLeastOfLight * b.light);
  for (int k = 0; k < kShading; ++k) {
    const Doubles most = (k < kShading - 1 ? b.light : b.body) * largest[k];
    m[at(kOwn + k, kOwn + k)] += 1.0 / (most * most);
    eliminate(kOwn + k, kAll - 1, m, r, square);
  }
  b.left_square = larger(zero, square);
}

void sum_columns(Block& b, const Sample* samples, const Variances& noise, const double* largest) {
  WeighedRow rows[kMostSamples];
  const Floats inverse_sharp = 1.0f / b.sharp_px;
  for (int k = 0; k < b.samples; ++k) {
    const Sample& c = samples[k];
    WeighedRow& row = rows[k];
    const Floats contrast = b.inner + b.strip - b.outer * c.ground;
    row.value[0] = c.inside, row.value[1] = c.outside, row.value[2] = change_with_offset(b, c);
    for (int i = 0; i < kShading; ++i) row.value[kOwn + i] = c.shading[i];
    row.value[kAll - 1] =
        (contrast * c.sloping_density - b.strip * c.sloping_strip_density) * inverse_sharp;
    row.value[kAll] = c.light - b.inner * c.inside - b.outer * c.outside;
    Floats parts[3];
    parts_of(c.share, parts);
    const Floats weight = 1.0f / variance_of(noise, parts, c.gain);
    for (int i = 0; i <= kAll; ++i) row.weighed[i] = weight * row.value[i];
  }
  const int n = b.samples;
  sum_row<0>(rows, n, b.normal + at(0, 0));
  sum_row<1>(rows, n, b.normal + at(1, 0));
  sum_row<2>(rows, n, b.normal + at(2, 0));
  sum_row<3>(rows, n, b.normal + at(3, 0));
  sum_row<4>(rows, n, b.normal + at(4, 0));
  sum_row<5>(rows, n, b.normal + at(5, 0));
  sum_row<6>(rows, n, b.normal + at(6, 0));
  sum_row<7>(rows, n, b.normal + at(7, 0));
  sum_row<8>(rows, n, b.normal + at(8, 0));
  static_assert(kAll == 9);
  Floats last[kAll + 1];
  sum_row<9>(rows, n, last);
  for (int i = 0; i < kAll; ++i) b.right[i] = last[i];
  for (int i = 0; i < 2; ++i) {
    const Floats off = b.expected_level[i] - (i == 0 ? b.inner : b.outer);
    b.normal[at(i, i)] += b.level_precision[i];
    b.right[i] += b.level_precision[i] * off;
    last[kAll] += b.level_precision[i] * off * off;
  }
  reduce(b, last[kAll], largest);
}

void find_noise(Block& b, const Sample* samples, const Variances& assumed) {
  const Floats zero = {};
  // Inverse of the 3 x 3 equations of levels and offset, by cofactors.
  const Doubles m00 = wide(b.normal[at(0, 0)]), m10 = wide(b.normal[at(1, 0)]),
                m11 = wide(b.normal[at(1, 1)]), m20 = wide(b.normal[at(2, 0)]),
                m21 = wide(b.normal[at(2, 1)]), m22 = wide(b.normal[at(2, 2)]) + 1.0;
  const Doubles c00 = m11 * m22 - m21 * m21, c10 = m20 * m21 - m10 * m22,
                c20 = m10 * m21 - m20 * m11;
  const Doubles inverse = 1.0 / (m00 * c00 + m10 * c10 + m20 * c20);
  const Doubles i00 = c00 * inverse, i10 = c10 * inverse, i20 = c20 * inverse,
                i11 = (m00 * m22 - m20 * m20) * inverse, i21 = (m10 * m20 - m00 * m21) * inverse,
                i22 = (m00 * m11 - m10 * m10) * inverse;
  Doubles r[kOwn];
  for (int i = 0; i < kOwn; ++i) r[i] = wide(b.right[i]);
  for (int k = 0; k < kShading; ++k) {
    const Doubles n0 = wide(b.normal[at(kOwn + k, 0)]), n1 = wide(b.normal[at(kOwn + k, 1)]),
                  n2 = wide(b.normal[at(kOwn + k, 2)]), shading = wide(b.shading[k]);
    r[0] -= n0 * shading, r[1] -= n1 * shading, r[2] -= n2 * shading;
    b.level_pull[0][k] = narrow(-(i00 * n0 + i10 * n1 + i20 * n2));
    b.level_pull[1][k] = narrow(-(i10 * n0 + i11 * n1 + i21 * n2));
  }
  const Floats own0 = narrow(i00 * r[0] + i10 * r[1] + i20 * r[2]),
               own1 = narrow(i10 * r[0] + i11 * r[1] + i21 * r[2]),
               own2 = narrow(i20 * r[0] + i21 * r[1] + i22 * r[2]);
  const Floats l00 = narrow(i00), l10 = narrow(2.0 * i10), l11 = narrow(i11),
               l20 = narrow(2.0 * i20), l21 = narrow(2.0 * i21), l22 = narrow(i22);
  const Floats inner = b.inner + own0, outer = b.outer + own1;
  Floats light_square = zero, square[3] = {}, freedom[3] = {};
  for (int k = 0; k < b.samples; ++k) {
    const Sample& c = samples[k];
    const Floats in = c.inside, out = c.outside, d = change_with_offset(b, c);
    Floats rest = c.light - inner * in - outer * out - own2 * d;
    for (int i = 0; i < kShading; ++i) rest -= c.shading[i] * b.shading[i];
    Floats parts[3];
    parts_of(c.share, parts);
    const Floats leverage =
        in * (l00 * in + l10 * out + l20 * d) + out * (l11 * out + l21 * d) + l22 * d * d;
    const Floats free = b.own_share * c.valid - leverage / variance_of(assumed, parts, c.gain);
    const Floats levels = rest / c.gain, levels_square = b.own_share * levels * levels;
    light_square += b.own_share * rest * rest;
    for (int i = 0; i < 3; ++i)
      square[i] += levels_square * parts[i], freedom[i] += free * parts[i];
  }
  b.inner = inner, b.outer = outer;
  b.light_square = light_square;
  b.level_variance[0] = l00, b.level_variance[1] = l11;
  for (int i = 0; i < 3; ++i) b.noise_square[i] = square[i], b.noise_freedom[i] = freedom[i];
}

void find_offsets(Block& b, const Sample* samples, const Variances& noise) {
  const Floats zero = {};
  const Floats* v = b.shading;
  const Floats strip = b.strip_px > zero ? v[4] : zero;
  Floats aa = zero, ab = zero, bb = zero, ad = zero, bd = zero, dd = zero;
  Floats ar = zero, br = zero, dr = zero;
  Floats of_a[kShading] = {}, of_b[kShading] = {}, of_d[kShading] = {};
  Floats strip_a = zero, strip_b = zero, strip_d = zero;  // of its inner edge
  for (int k = 0; k < b.samples; ++k) {
    const Sample& c = samples[k];
    const Floats in = c.inside, out = c.outside, ground = c.ground;
    const Floats of_strip = -strip * c.strip_density;
    const Floats d = (b.inner + strip - b.outer * ground) * c.density + of_strip +
                     (v[0] - v[1] * ground) * c.sloping_density +
                     (v[2] - v[3] * ground) * c.bending_density;
    Floats rest = c.light - b.inner * in - b.outer * out;
    for (int i = 0; i < kShading; ++i) rest -= c.shading[i] * v[i];
    Floats parts[3];
    parts_of(c.share, parts);
    const Floats weight = 1.0f / variance_of(noise, parts, c.gain);
    const Floats wa = weight * in, wb = weight * out, wd = weight * d;
    aa += wa * in, ab += wb * in, bb += wb * out, ad += wd * in, bd += wd * out, dd += wd * d;
    ar += wa * rest, br += wb * rest, dr += wd * rest;
    strip_a += wa * of_strip, strip_b += wb * of_strip, strip_d += wd * of_strip;
    for (int i = 0; i < kShading; ++i) {
      of_a[i] += wa * c.shading[i];
      of_b[i] += wb * c.shading[i];
      of_d[i] += wd * c.shading[i];
    }
  }
  aa += b.level_precision[0], ar += b.level_precision[0] * (b.expected_level[0] - b.inner);
  bb += b.level_precision[1], br += b.level_precision[1] * (b.expected_level[1] - b.outer);
  const Floats determinant = aa * bb - ab * ab;
  // d with the levels projected out.
  const Floats in = (bb * ad - ab * bd) / determinant, out = (aa * bd - ab * ad) / determinant;
  b.information = dd - in * ad - out * bd;
  b.offset_px = (dr - in * ar - out * br) / b.information;
  b.strip_share = (strip_d - in * strip_a - out * strip_b) / b.information;
  for (int i = 0; i < kShading; ++i)
    b.pull[i] = (of_d[i] - in * of_a[i] - out * of_b[i]) / b.information;
  const Floats off = larger(b.offset_px, -b.offset_px);
  b.found =
      b.usable & (determinant > 1e-4f * aa * bb) & (b.information > 1e-4f) & (off <= b.reach_px);
}

// With shading s of diagonal covariance V, right sides r = N s + noise have E[r_k^2] =
// sum_l N_kl^2 V_l + N_kk: sums over some looks of N_kl^2 and of r_k^2 - N_kk.
struct Moments {
  static constexpr int kValues = kShading * kShading + kShading;
  double value[kValues] = {};

  TROCHOID_INLINE void add(const CurveLooks& looks, int i, double sign) {
    if (!looks.usable[i]) return;
    const double* normal = looks.normal + i * looks.normal_stride;
    const double* rest = looks.rest + i * looks.rest_stride;
    for (int k = 0; k < kShading * kShading; ++k) value[k] += sign * (normal[k] * normal[k]);
    for (int k = 0; k < kShading; ++k)
      value[kShading * kShading + k] += sign * (rest[k] * rest[k] - normal[k * kShading + k]);
  }
};

TROCHOID_INLINE double clamped(double x, double most) {
  x = x > 0.0 ? x : 0.0;
  return x < most ? x : most;
}

// Minimises x^T A x / 2 - b^T x over 0 <= x <= 1, A positive semidefinite, one coordinate at a
// time, from x; ends early where a sweep hardly changes anything. Where the sums hold no more than
// what rounding leaves of looks that are gone (`whole`: with all of them), x stays.
TROCHOID_INLINE void least_within_bounds(const Moments& sums, const Moments& whole, int sweeps,
                                         double* x) {
  constexpr double kMost = 1.0, kSettled = 1e-6, kRounding = 1e-12;
  const double* A = sums.value;
  double g[kShading], inverse[kShading];
  for (int k = 0; k < kShading; ++k) {
    g[k] = A[kShading * kShading + k];
    for (int l = 0; l < kShading; ++l) g[k] -= A[l * kShading + k] * x[l];
    const double diagonal = A[k * kShading + k];
    const bool known = diagonal > kRounding * whole.value[k * kShading + k];
    inverse[k] = known ? 1.0 / diagonal : 0.0;
  }
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    double most = 0.0;
#pragma GCC unroll 5
    for (int k = 0; k < kShading; ++k) {
      const double next = inverse[k] > 0.0 ? clamped(x[k] + g[k] * inverse[k], kMost) : x[k];
      const double step = next - x[k];
      x[k] = next;
      for (int l = 0; l < kShading; ++l) g[l] -= step * A[k * kShading + l];
      const double size = __builtin_fabs(step);
      most = size > most ? size : most;
    }
    if (most < kSettled) break;
  }
}

constexpr int kSweeps = 3, kSweepsFromNothing = 12;

void find_variances(const CurveLooks& looks, int reach, double* variances, double* curve_variances,
                    double* curve_squares) {
  const int n = looks.count;
  Moments whole, around;
  for (int i = 0; i < n; ++i) whole.add(looks, i, 1.0);
  for (int k = 0; k < kShading; ++k) curve_variances[k] = 0.0;
  least_within_bounds(whole, whole, kSweepsFromNothing, curve_variances);
  for (int k = 0; k < kShading; ++k) curve_squares[k] = whole.value[k * kShading + k];
  for (int i = 0; i < (reach < n ? reach : n); ++i) around.add(looks, i, 1.0);
  double found[kShading] = {};
  least_within_bounds(around, whole, kSweepsFromNothing, found);
  for (int i = 0; i < n; ++i) {
    if (i + reach < n) around.add(looks, i + reach, 1.0);
    if (i > reach) around.add(looks, i - reach - 1, -1.0);
    least_within_bounds(around, whole, kSweeps, found);
    for (int k = 0; k < kShading; ++k) variances[i * kShading + k] = found[k];
  }
}

// Calls use(k) for groups of four of N values; the last may begin within the one before.
template <int N, class Use>
TROCHOID_INLINE void by_fours(const Use& use) {
#pragma GCC unroll 8
  for (int k = 0; k < N; k += 4) use(k + 4 <= N ? k : N - 4);
}

// N values of each of so many looks, `stride` doubles apart, side by side; of what lanes are left
// over, those of the last. (Lane by lane they would be stored in parts and read as a whole.)
template <int N>
TROCHOID_INLINE void gather(const double* first, int stride, int lanes, Doubles* out) {
  const auto of_look = [&](int l) { return first + (l < lanes ? l : lanes - 1) * stride; };
  by_fours<N>([&](int k) __attribute__((always_inline)) {
    Quad low[4], high[4];
    for (int l = 0; l < 4; ++l)
      low[l] = loaded<Quad>(of_look(l) + k), high[l] = loaded<Quad>(of_look(4 + l) + k);
    transpose(low), transpose(high);
    for (int i = 0; i < 4; ++i)
      out[k + i] = __builtin_shufflevector(low[i], high[i], 0, 1, 2, 3, 4, 5, 6, 7);
  });
}

// The other way round.
template <int N>
TROCHOID_INLINE void scatter(const Doubles* values, double* first, int stride, int lanes) {
  by_fours<N>([&](int k) __attribute__((always_inline)) {
    Quad q[kLanes];
    for (int i = 0; i < 4; ++i) {
      q[i] = __builtin_shufflevector(values[k + i], values[k + i], 0, 1, 2, 3);
      q[4 + i] = __builtin_shufflevector(values[k + i], values[k + i], 4, 5, 6, 7);
    }
    transpose(q), transpose(q + 4);
    for (int l = 0; l < lanes; ++l) __builtin_memcpy(first + l * stride + k, &q[l], sizeof q[l]);
  });
}

void estimate(const CurveLooks& looks, const double* variances, double* covariance,
              int covariance_stride, double* shading, int shading_stride) {
  constexpr int kWhole = kShading * kShading;
  const int count = looks.count;
  for (int first = 0; first < count; first += kLanes) {
    const int lanes = count - first < kLanes ? count - first : kLanes;
    Doubles whole[kWhole], m[at(kShading, 0)], r[kShading], variance[kShading];
    gather<kWhole>(looks.normal + first * looks.normal_stride, looks.normal_stride, lanes, whole);
    gather<kShading>(looks.rest + first * looks.rest_stride, looks.rest_stride, lanes, r);
    gather<kShading>(variances + first * kShading, kShading, lanes, variance);
    for (int i = 0; i < kShading; ++i)
      for (int j = 0; j <= i; ++j) m[at(i, j)] = whole[i * kShading + j];
    for (int k = 0; k < kShading; ++k) m[at(k, k)] += 1.0 / variance[k];
    // Gauss-Jordan, one pivot after the other; leaves minus the inverse.
    const auto element = [](int i, int j) { return i >= j ? at(i, j) : at(j, i); };
#pragma GCC unroll 5
    for (int k = 0; k < kShading; ++k) {
      const Doubles inverse = 1.0 / m[at(k, k)];
      Doubles column[kShading];
      for (int i = 0; i < kShading; ++i) column[i] = m[element(i, k)];
#pragma GCC unroll 5
      for (int i = 0; i < kShading; ++i) {
        if (i == k) continue;
        const Doubles scaled = inverse * column[i];
#pragma GCC unroll 5
        for (int j = 0; j <= i; ++j)
          if (j != k) m[at(i, j)] -= scaled * column[j];
        m[element(i, k)] = scaled;
      }
      m[at(k, k)] = -inverse;
    }
    Doubles sums[kShading];
    for (int i = 0; i < kShading; ++i) {
      sums[i] = Doubles{};
      for (int j = 0; j < kShading; ++j) {
        sums[i] -= m[element(i, j)] * r[j];
        whole[i * kShading + j] = -m[element(i, j)];
      }
    }
    scatter<kWhole>(whole, covariance + first * covariance_stride, covariance_stride, lanes);
    scatter<kShading>(sums, shading + first * shading_stride, shading_stride, lanes);
  }
}

}  // namespace

extern const Kernel TROCHOID_STRETCH_ISA;
const Kernel TROCHOID_STRETCH_ISA{put_side_by_side, find_columns,   sum_columns, find_noise,
                                  find_offsets,     find_variances, estimate};

}  // namespace trochoid::tracking::stretch
