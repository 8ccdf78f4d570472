#pragma once

/// Inner loops of edge_stretch.cpp and shading_prior.cpp for eight looks at an outline side by
/// side, compiled once for every machine and once for those with AVX2 (kernel_*.cpp,
/// stretch_dispatch.cpp). Plain data only: a file compiled for wide vectors shares no Eigen type
/// and no inline function with others.
namespace trochoid::tracking::stretch {

inline constexpr int kLanes = 8;
inline constexpr int kMostSamples = 96;  ///< of a look
inline constexpr int kAlign =
    8 * kLanes;  // of structures: what it would be depends on the instruction set
using Floats = float __attribute__((vector_size(4 * kLanes)));
using Doubles = double __attribute__((vector_size(8 * kLanes)));
using Masks = int __attribute__((vector_size(4 * kLanes)));  // -1: true

// Unknowns of the linear model: inner level, outer level and offset; slope inside and outside, bend
// inside and outside, by how much a strip at the edge differs from the rest of the body; blur.
inline constexpr int kOwn = 3, kShading = 5, kAll = kOwn + kShading + 1;
/// Place of element i, j with j <= i in a lower triangle.
constexpr int at(int i, int j) {
  return i * (i + 1) / 2 + j;
}

static_assert(kMostSamples % 4 == 0);  // they are read by fours

/// Tables the kernels read.
struct Tables {
  const float* normal;  ///< NormalTable: share and density in turns
  const float* gain;    ///< of light 0..255
};

/// One sample of each look. Of samples past the end of a look all but the gain are 0.
struct alignas(kAlign) Sample {
  // Given.
  Floats s_px, light, ground;  ///< the plate over its mean, 1 without
  Floats valid;                ///< 1, or 0 past the end
  // By find_columns: how much of it lies outside of an edge that sweeps, the levels' columns, how
  // fast the first, a slope and a bend grow with the edge; slopes, bends and strip.
  Floats share, inside, outside;
  Floats density, sloping_density, bending_density;
  Floats strip_density, sloping_strip_density;  // of the strip's inner edge
  Floats shading[kShading];
  Floats gain;  ///< of the light, over the levels of the picture, in which noise is even
};

/// Eight looks, sums over their samples and what these say.
struct alignas(kAlign) Block {
  // Given: steps at which an edge is while it sweeps, each with its share; a still one has one.
  static constexpr int kMostSteps = 12;
  int samples = 0, steps = 1;
  Floats step_at_px[kMostSteps] = {}, step_part[kMostSteps] = {};
  Floats sharp_px = {};   ///< blur of each step
  Floats strip_px = {};   ///< 0: none
  Floats curved = {};     ///< 1: noise is even in levels that are not proportional to light
  Floats own_share = {};  ///< independent samples per sample
  Floats reach_px = {};
  // Given or 0: what the levels inside and outside are expected to be, in light, and how surely, as
  // the inverse variance.
  Floats expected_level[2] = {}, level_precision[2] = {};
  // Given or 0: by how much the strip's light differs from that of the rest, for how the picture
  // changes with the offset and the blur. Its inner edge moves along with the outer one.
  Floats strip = {};
  // By find_columns.
  Masks usable = {};
  Floats inner = {}, outer = {};  ///< levels of the plain step
  // By sum_columns.
  Floats normal[at(kAll, 0)], right[kAll];
  Doubles light;  ///< brighter level
  Doubles body;   ///< level inside, at least a share of `light`
  // Of shading and blur with levels and offset free; of all residuals, after fitting everything.
  Doubles shading_normal[at(kShading, 0)], shading_right[kShading], blur_cross[kShading];
  Doubles blur_normal, blur_right, left_square;
  // Given for find_noise and find_offsets.
  Floats shading[kShading] = {};
  // By find_noise: sums of squared residuals in light, then in levels with their degrees of freedom
  // inside, outside and on the edge; variances of the levels, were that of the noise as
  // assumed, and how the levels go with the shading.
  Floats light_square, noise_square[3], noise_freedom[3], level_variance[2];
  Floats level_pull[2][kShading];
  // By find_offsets.
  Masks found;
  Floats offset_px, information, pull[kShading];
  Floats strip_share;  ///< of the offset, that the strip's inner edge tells
};

/// Eight looks as they were taken, each in arrays of its own, of kMostSamples.
struct alignas(kAlign) Lanes {
  const float *s_px[kLanes], *light[kLanes], *ground[kLanes];
  Masks count = {};        ///< of samples
  Floats per_ground = {};  ///< by which `ground` is multiplied; 0: it is 1
};

/// Variances of a sample inside, outside and on the edge.
struct alignas(kAlign) Variances {
  Floats part[3];
};

/// Looks at one curve, one after the other; matrices are whole, `stride` doubles apart.
struct CurveLooks {
  int count;
  const double *normal, *rest;  ///< of each look; rest: right side beyond what is expected
  int normal_stride, rest_stride;
  const unsigned char* usable;
};

struct Kernel {
  /// What is given of so many samples, from one look after the other.
  void (*put_side_by_side)(const Lanes&, int samples, Sample*);
  /// Columns of the model, levels of the plain step, gains.
  void (*find_columns)(Block&, Sample*, const Tables&);
  /// Sums of all columns, samples weighed by their noise, with what is expected of the levels;
  /// projects levels and offset out of those for shading and blur, and shading as large as it can
  /// be (of unit light, the strip of that of the body) out of the square.
  void (*sum_columns)(Block&, const Sample*, const Variances&, const double* largest_shading);
  /// Residuals beside and on the edge about the best step with the given shading, whose levels it
  /// keeps, and the degrees of freedom that the fit has left them.
  void (*find_noise)(Block&, const Sample*, const Variances&);
  /// The offset with shading given, samples weighed by their noise.
  void (*find_offsets)(Block&, const Sample*, const Variances&);
  /// Variances of the shading beside every look by the looks up to `reach` before and after, and
  /// what they are at least by the whole curve: `curve_variances` with the deviations of its sums.
  void (*find_variances)(const CurveLooks&, int reach, double* variances, double* curve_variances,
                         double* curve_squares);
  /// (normal + 1 / variance)^-1 and that times rest.
  void (*estimate)(const CurveLooks&, const double* variances, double* covariance,
                   int covariance_stride, double* shading, int shading_stride);
};

/// The widest this machine has.
[[nodiscard]] const Kernel& kernel();

}  // namespace trochoid::tracking::stretch
