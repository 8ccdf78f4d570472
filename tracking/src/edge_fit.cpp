#include "edge_fit.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <type_traits>

namespace trochoid::tracking {
namespace {

// Half-pixel samples of a bilinear picture: about every second one is independent.
constexpr double kPerIndependent = 2.0;

// Normal distribution and density, tabulated: the edge fit evaluates them a million times a second.
struct NormalTable {
  static constexpr float kRange = 4.0f;
  static constexpr int kPerUnit = 64;
  static constexpr int kSize = 2 * 4 * kPerUnit + 2;
  std::array<float, kSize> share{}, density{};
  NormalTable() {
    for (int i = 0; i < kSize; ++i) {
      const double x = static_cast<double>(i) / kPerUnit - kRange;
      share[static_cast<size_t>(i)] = static_cast<float>(0.5 * std::erfc(-x / std::numbers::sqrt2));
      density[static_cast<size_t>(i)] =
          static_cast<float>(std::exp(-0.5 * x * x) / std::sqrt(2.0 * std::numbers::pi));
    }
  }
};

struct Step {
  float share, density;
};

inline Step step_at(const NormalTable& table, float x) {
  const float place =
      (std::clamp(x, -NormalTable::kRange, NormalTable::kRange) + NormalTable::kRange) *
      NormalTable::kPerUnit;
  const int i = static_cast<int>(place);
  const float part = place - static_cast<float>(i);
  return {table.share[i] + part * (table.share[i + 1] - table.share[i]),
          table.density[i] + part * (table.density[i + 1] - table.density[i])};
}

// Levels beside the edge: inner and outer, then their slopes, then their bends.
constexpr int kMostLevels = 6;
using Levels = Eigen::Matrix<float, kMostLevels, 1>;
using Normal = Eigen::Matrix<float, kMostLevels, kMostLevels>;

// One profile being fitted: samples, their weights and columns for a step at some offset.
class EdgeFit {
 public:
  EdgeFit(const Profile& profile, const EdgeModel& model)
      : profile_(profile), model_(model), inverse_blur_(1.0f / static_cast<float>(model.blur_px)) {
    float brightest = 1.0f, ground = 0.0f;
    for (int j = 0; j < profile.count; ++j) {
      brightest = std::max(brightest, profile.light[j]);
      ground += model.plate ? profile.background[j] : 1.0f;
    }
    // Slopes [per px] and bends [per px^2] of the light, as shares of it.
    constexpr float kSlope = 0.06f, kBend = 0.02f;
    const float outer = brightest * static_cast<float>(profile.count) / std::max(ground, 1.0f);
    const auto precision = [](float sd) { return 1.0f / (sd * sd); };
    prior_ << 0.0f, 0.0f, precision(kSlope * brightest), precision(kSlope * outer),
        precision(kBend * brightest), precision(kBend * outer);
  }

  // Best levels for a step at `offset`.
  bool solve_levels(float offset) {
    static const NormalTable table;
    normal_.setZero();
    Levels right = Levels::Zero();
    const auto inner = static_cast<float>(kPerIndependent * model_.inner_noise2);
    const auto outer = static_cast<float>(kPerIndependent * model_.outer_noise2);
    for (int j = 0; j < profile_.count; ++j) {
      const float s = profile_.s_px(j);
      steps_[j] = step_at(table, (s - offset) * inverse_blur_);
      weights_[j] = 1.0f / (inner + steps_[j].share * (outer - inner));
      const Levels c = columns(j);
      if (model_.shading) {
        normal_.noalias() += (weights_[j] * c) * c.transpose();
      } else {
        normal_(0, 0) += weights_[j] * c[0] * c[0];
        normal_(0, 1) += weights_[j] * c[0] * c[1];
        normal_(1, 1) += weights_[j] * c[1] * c[1];
      }
      right += weights_[j] * profile_.light[j] * c;
    }
    normal_(1, 0) = normal_(0, 1);
    inverse_.setZero();
    return model_.shading ? solve<kMostLevels>(right) : solve<2>(right);
  }

  struct Move {
    double step, information, information_of_noise;
  };
  // One Gauss-Newton step of the offset with the levels projected out.
  [[nodiscard]] Move move() const {
    Levels cross = Levels::Zero();
    float own = 0.0f, residual = 0.0f;
    for (int j = 0; j < profile_.count; ++j) {
      const float s = profile_.s_px(j), ground = ground_at(j);
      const float inner = levels_[0] + s * (levels_[2] + s * levels_[4]);
      const float outer = levels_[1] + s * (levels_[3] + s * levels_[5]);
      const float d = (inner - outer * ground) * steps_[j].density * inverse_blur_;
      const Levels c = columns(j);
      cross += weights_[j] * d * c;
      own += weights_[j] * d * d;
      residual += weights_[j] * d * (profile_.light[j] - levels_.dot(c));
    }
    const float projected = own - cross.dot(inverse_ * cross);
    const Eigen::Matrix2f two = normal_.topLeftCorner<2, 2>();
    const float determinant = two(0, 0) * two(1, 1) - two(0, 1) * two(0, 1);
    const float of_levels =
        (two(1, 1) * cross[0] * cross[0] - 2.0f * two(0, 1) * cross[0] * cross[1] +
         two(0, 0) * cross[1] * cross[1]) /
        determinant;
    return {projected > 1e-9f ? residual / projected : 0.0, projected, own - of_levels};
  }

  void describe(double offset, ProfileEdge& edge) const {
    const auto s = static_cast<float>(offset);
    edge.inner = levels_[0] + s * (levels_[2] + s * levels_[4]);
    const double ground = model_.plate ? profile_.background_at(offset) : 1.0;
    edge.contrast = (levels_[1] + s * (levels_[3] + s * levels_[5])) * ground - edge.inner;
    edge.inner_slope = levels_[2] + 2.0f * s * levels_[4];
    edge.outer_slope = (levels_[3] + 2.0f * s * levels_[5]) * ground;
    edge.inner_square = edge.outer_square = edge.inner_freedom = edge.outer_freedom = 0.0;
    for (int j = 0; j < profile_.count; ++j) {
      const double residual = profile_.light[j] - levels_.dot(columns(j));
      const double square = residual * residual / kPerIndependent, share = steps_[j].share;
      edge.inner_square += (1.0 - share) * square;
      edge.outer_square += share * square;
      edge.inner_freedom += (1.0 - share) / kPerIndependent;
      edge.outer_freedom += share / kPerIndependent;
    }
    // Half of what was fitted comes from either side; priors make slopes and bends count less.
    const double fitted = model_.shading ? 1.9 : 1.2;
    edge.inner_freedom = std::max(0.2, edge.inner_freedom - fitted);
    edge.outer_freedom = std::max(0.2, edge.outer_freedom - fitted);
  }

 private:
  [[nodiscard]] float ground_at(int j) const {
    return model_.plate ? profile_.background[j] : 1.0f;
  }
  [[nodiscard]] Levels columns(int j) const {
    const float s = profile_.s_px(j), share = steps_[j].share;
    const float inner = 1.0f - share, outer = share * ground_at(j);
    Levels c;
    c << inner, outer, inner * s, outer * s, inner * s * s, outer * s * s;
    return c;
  }
  template <int n>
  bool solve(const Levels& right) {
    Eigen::Matrix<double, n, n> part =
        normal_.template topLeftCorner<n, n>().template cast<double>();
    part.diagonal() += prior_.template head<n>().template cast<double>();
    const Eigen::LDLT<Eigen::Matrix<double, n, n>> factor(part);
    if (!(factor.vectorD().minCoeff() > 1e-9)) return false;
    inverse_.template topLeftCorner<n, n>() =
        factor.solve(Eigen::Matrix<double, n, n>::Identity()).template cast<float>();
    levels_.setZero();
    levels_.template head<n>() =
        factor.solve(right.template head<n>().template cast<double>()).template cast<float>();
    return true;
  }

  const Profile& profile_;
  const EdgeModel& model_;
  float inverse_blur_;
  Levels prior_, levels_;
  Normal normal_, inverse_;
  std::array<Step, Profile::kMost> steps_;
  std::array<float, Profile::kMost> weights_;
};

// Squared residual of the best line (or, with a plate, the best multiple of it plus a constant).
double square_without_edge(const Profile& p, bool plate) {
  double n = 0, g = 0, gg = 0, i = 0, gi = 0, ii = 0;
  for (int j = 0; j < p.count; ++j) {
    const double ground = plate ? p.background[j] : p.s_px(j), light = p.light[j];
    n += 1, g += ground, gg += ground * ground, i += light, gi += ground * light,
        ii += light * light;
  }
  const double spread = gg - g * g / n, along = gi - g * i / n;
  return std::max(0.0, ii - i * i / n - (spread > 1e-9 ? along * along / spread : 0.0));
}

}  // namespace

bool fit_edge(const Profile& profile, const EdgeModel& model, double start_px, double reach_px,
              int iterations, ProfileEdge& edge) {
  constexpr int kFewest = 6;
  constexpr double kSettledPx = 0.02, kLeastNoise2 = 0.1;
  if (profile.count < kFewest) return false;
  double offset = start_px;
  EdgeFit fit(profile, model);
  EdgeFit::Move move{};
  for (int i = 0; i < iterations; ++i) {
    if (!fit.solve_levels(static_cast<float>(offset))) return false;
    move = fit.move();
    const double step =
        iterations > 1 ? std::clamp(move.step, -model.blur_px, model.blur_px) : move.step;
    offset += step;
    if (std::abs(offset - start_px) > reach_px) return false;
    if (std::abs(step) < kSettledPx) break;
  }
  if (!(move.information > 1e-9)) return false;
  edge.offset_px = offset;
  edge.noise_variance_px2 = 1.0 / move.information_of_noise;
  edge.shading_variance_px2 = std::max(0.0, 1.0 / move.information - edge.noise_variance_px2);
  fit.describe(offset, edge);
  const double freedom = std::max(1.0, edge.inner_freedom + edge.outer_freedom);
  edge.gain = 0.5 * freedom *
              std::log((square_without_edge(profile, model.plate) / kPerIndependent +
                        freedom * kLeastNoise2) /
                       (edge.inner_square + edge.outer_square + freedom * kLeastNoise2));
  return true;
}

}  // namespace trochoid::tracking
