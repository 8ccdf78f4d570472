#include "edges/edge_fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "edges/normal_table.hpp"
#include "trochoid/data/angle.hpp"

namespace trochoid::tracking {
namespace {

// Sums over a profile for a step at some offset.
struct Sums {
  float aa = 0, ab = 0, bb = 0, ay = 0, by = 0;      // levels
  float ad = 0, bd = 0, dd = 0, dr = 0, square = 0;  // derivative by the offset, residual
  float inner = 0, outer = 0;

  bool fit(const Profile& p, float inverse_blur, bool plate, float offset) {
    const NormalTable& table = NormalTable::instance();
    std::array<NormalTable::Step, Profile::kMost> steps;
    for (int j = 0; j < p.count; ++j) {
      const auto k = static_cast<size_t>(j);
      steps[k] = table.at((p.s_px[k] - offset) * inverse_blur);
      const float ground = plate ? p.background[k] : 1.0f;
      const float a = 1.0f - steps[k].share, b = steps[k].share * ground, y = p.light[k];
      aa += a * a, ab += a * b, bb += b * b, ay += a * y, by += b * y;
    }
    const float determinant = aa * bb - ab * ab;
    if (!(determinant > 1e-4f * aa * bb)) return false;
    inner = (bb * ay - ab * by) / determinant;
    outer = (aa * by - ab * ay) / determinant;
    for (int j = 0; j < p.count; ++j) {
      const auto k = static_cast<size_t>(j);
      const float ground = plate ? p.background[k] : 1.0f;
      const float a = 1.0f - steps[k].share, b = steps[k].share * ground;
      const float d = (inner - outer * ground) * steps[k].density * inverse_blur;
      const float rest = p.light[k] - inner * a - outer * b;
      ad += a * d, bd += b * d, dd += d * d, dr += d * rest, square += rest * rest;
    }
    return true;
  }
  // Of the offset, with the levels projected out, for samples of unit variance.
  [[nodiscard]] float information() const {
    const float determinant = aa * bb - ab * ab;
    return dd - (bb * ad * ad - 2.0f * ab * ad * bd + aa * bd * bd) / determinant;
  }
};

}  // namespace

NormalTable::NormalTable() {
  for (size_t i = 0; i < entries_.size(); ++i) {
    const double x = static_cast<double>(i) / kPerUnit - static_cast<double>(kRange);
    entries_[i] = {static_cast<float>(0.5 * std::erfc(-x / std::numbers::sqrt2)),
                   static_cast<float>(std::exp(-0.5 * x * x) / std::sqrt(2.0 * data::kPi))};
  }
}

const NormalTable& NormalTable::instance() {
  static const NormalTable table;
  return table;
}

double square_without_edge(const Profile& p, bool plate) {
  float n = 0, g = 0, gg = 0, i = 0, gi = 0, ii = 0;
  // About the first sample: sums of large squares would cancel.
  const float base = p.light[0];
  for (int j = 0; j < p.count; ++j) {
    const auto k = static_cast<size_t>(j);
    const float ground = plate ? p.background[k] - p.background[0] : p.s_px[k];
    const float light = p.light[k] - base;
    n += 1, g += ground, gg += ground * ground, i += light, gi += ground * light,
        ii += light * light;
  }
  const float spread = gg - g * g / n, along = gi - g * i / n;
  return std::max(0.0f, ii - i * i / n - (spread > 1e-6f ? along * along / spread : 0.0f));
}

bool fit_edge(const Profile& profile, double blur_px, bool plate, double reach_px,
              ProfileEdge& edge) {
  constexpr int kFewest = 6, kIterations = 4;
  constexpr double kSettledPx = 0.03, kLeastNoise2 = 0.1, kUsualNoise2 = 2.0;
  if (profile.count < kFewest) return false;
  const auto inverse_blur = static_cast<float>(1.0 / blur_px);
  double offset = 0.0, information = 0.0;
  Sums sums;
  for (int i = 0; i < kIterations; ++i) {
    sums = {};
    if (!sums.fit(profile, inverse_blur, plate, static_cast<float>(offset))) return false;
    information = static_cast<double>(sums.information());
    if (!(information > 1e-6)) return false;
    const double step = std::clamp(static_cast<double>(sums.dr) / information, -blur_px, blur_px);
    offset += step;
    if (std::abs(offset) > reach_px) return false;
    if (std::abs(step) < kSettledPx) break;
  }
  edge.offset_px = offset;
  edge.noise_variance_px2 = profile.shared * kUsualNoise2 / information;
  edge.shading_variance_px2 = edge.strip_variance_px2 = edge.strip_share = edge.inner_slope =
      edge.outer_slope = 0.0;
  const double ground = plate ? profile.background[profile.nearest(offset)] : 1.0;
  edge.contrast = static_cast<double>(sums.outer) * ground - static_cast<double>(sums.inner);
  edge.mean_level = static_cast<double>(sums.inner) + 0.5 * edge.contrast;
  const double freedom = std::max(1.0, profile.count / profile.shared - 2.4);
  edge.lines = profile.lines;
  edge.gain = 0.5 * freedom / profile.lines *
              std::log((square_without_edge(profile, plate) + freedom * kLeastNoise2) /
                       (static_cast<double>(sums.square) + freedom * kLeastNoise2));
  return true;
}

}  // namespace trochoid::tracking
