#include "edge_profile.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <type_traits>
#include <vector>

namespace trochoid::tracking {
namespace {

// Inverse of the transfer curve cameras apply (sRGB; BT.709 differs by less than 2 levels).
const std::array<float, 256>& light_of_luma() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> t{};
    for (int i = 0; i < 256; ++i) {
      const double v = i / 255.0;
      t[static_cast<size_t>(i)] = static_cast<float>(
          255.0 * (v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4)));
    }
    return t;
  }();
  return table;
}

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

// Levels beside the edge: inner and outer, and their slopes along the profile.
using Levels = Eigen::Vector4d;
using Normal = Eigen::Matrix4d;

struct LevelFit {
  Levels levels = Levels::Zero();
  Normal inverse = Normal::Zero();  // of the normal equations, unused rows zero
  double square = 0.0;
};

// Columns of the linear part: what one unit of each level adds to a sample.
Eigen::Vector4f columns_at(const Profile& p, bool plate, int j, float share) {
  const float ground = plate ? p.background[j] : 1.0f, inner = 1.0f - share, outer = share * ground;
  const float s = p.s_px(j);
  return {inner, outer, inner * s, outer * s};
}

// Least squares of the levels for a step at `offset`; slopes only when asked for.
bool fit_levels(const Profile& p, const EdgeModel& model, float offset, LevelFit& out,
                std::array<Step, Profile::kMost>& steps) {
  static const NormalTable table;
  const float inverse_blur = 1.0f / static_cast<float>(model.blur_px);
  Eigen::Matrix4f normal = Eigen::Matrix4f::Zero();
  Eigen::Vector4f right = Eigen::Vector4f::Zero();
  float square = 0.0f;
  for (int j = 0; j < p.count; ++j) {
    steps[j] = step_at(table, (p.s_px(j) - offset) * inverse_blur);
    const Eigen::Vector4f c = columns_at(p, model.plate, j, steps[j].share);
    normal.noalias() += c * c.transpose();
    right += p.light[j] * c;
    square += p.light[j] * p.light[j];
  }
  out.inverse.setZero();
  const auto solve = [&](auto size) {
    constexpr int n = decltype(size)::value;
    const Eigen::Matrix<double, n, n> part =
        normal.template topLeftCorner<n, n>().template cast<double>();
    const Eigen::LDLT<Eigen::Matrix<double, n, n>> factor(part);
    if (!(factor.vectorD().minCoeff() > 1e-6)) return false;
    out.inverse.template topLeftCorner<n, n>() =
        factor.solve(Eigen::Matrix<double, n, n>::Identity());
    out.levels = out.inverse * right.cast<double>();
    return true;
  };
  if (!(model.slopes ? solve(std::integral_constant<int, 4>{})
                     : solve(std::integral_constant<int, 2>{})))
    return false;
  out.square = std::max(0.0, static_cast<double>(square) - out.levels.dot(right.cast<double>()));
  return true;
}

struct OffsetStep {
  double step, information;
};

// One Gauss-Newton step of the offset with the levels projected out.
OffsetStep offset_step(const Profile& p, const EdgeModel& model, const LevelFit& fit,
                       const std::array<Step, Profile::kMost>& steps) {
  const Eigen::Vector4f levels = fit.levels.cast<float>();
  const float inverse_blur = 1.0f / static_cast<float>(model.blur_px);
  Eigen::Vector4f with_levels = Eigen::Vector4f::Zero();
  float own = 0.0f, residual = 0.0f;
  for (int j = 0; j < p.count; ++j) {
    const float s = p.s_px(j), ground = model.plate ? p.background[j] : 1.0f;
    const float jump = levels[0] + levels[2] * s - (levels[1] + levels[3] * s) * ground;
    const float d = jump * steps[j].density * inverse_blur;
    const Eigen::Vector4f c = columns_at(p, model.plate, j, steps[j].share);
    with_levels += d * c;
    own += d * d;
    residual += d * (p.light[j] - levels.dot(c));
  }
  const Eigen::Vector4d cross = with_levels.cast<double>();
  const double projected = own - cross.dot(fit.inverse * cross);
  return {projected > 1e-9 ? residual / projected : 0.0, projected};
}

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

LightWindow::LightWindow(const cv::Mat& luma, const cv::Rect& window)
    : window_(window & cv::Rect(0, 0, luma.cols, luma.rows)) {
  if (window_.width < 2 || window_.height < 2) {
    window_ = {};
    return;
  }
  const auto& table = light_of_luma();
  light_.create(window_.height, window_.width, CV_32FC1);
  for (int y = 0; y < window_.height; ++y) {
    const auto* from = luma.ptr<unsigned char>(window_.y + y) + window_.x;
    auto* to = light_.ptr<float>(y);
    for (int x = 0; x < window_.width; ++x) to[x] = table[from[x]];
  }
}

LightWindow LightWindow::blurred(double sigma_px) const {
  LightWindow out;
  if (empty()) return out;
  out.window_ = window_;
  cv::GaussianBlur(light_, out.light_, {}, sigma_px, sigma_px, cv::BORDER_REPLICATE);
  return out;
}

void LightWindow::scale_to(const LightWindow& picture) {
  constexpr int kStridePx = 3;
  constexpr float kDark = 2.0f;  // ratios of darker pixels are mostly noise
  if (empty() || picture.empty()) return;
  std::vector<float> ratios;
  for (int y = 0; y < light_.rows; y += kStridePx)
    for (int x = 0; x < light_.cols; x += kStridePx)
      if (light_.at<float>(y, x) > kDark)
        ratios.push_back(picture.light_.at<float>(y, x) / light_.at<float>(y, x));
  if (ratios.empty()) return;
  const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
  std::nth_element(ratios.begin(), middle, ratios.end());
  light_ *= *middle;
}

float LightWindow::at(float x_px, float y_px) const {
  const float x = x_px - static_cast<float>(window_.x), y = y_px - static_cast<float>(window_.y);
  const int ix = static_cast<int>(x), iy = static_cast<int>(y);
  const float fx = x - static_cast<float>(ix), fy = y - static_cast<float>(iy);
  const float* upper = light_.ptr<float>(iy) + ix;
  const float* lower = upper + light_.step1();
  const float top = upper[0] + fx * (upper[1] - upper[0]);
  const float bottom = lower[0] + fx * (lower[1] - lower[0]);
  return top + fy * (bottom - top);
}

void Profile::begin_at(double s) {
  int skipped = 0;
  while (skipped + 1 < count && s_px(skipped) < s) ++skipped;
  std::copy(light.begin() + skipped, light.begin() + count, light.begin());
  if (plate)
    std::copy(background.begin() + skipped, background.begin() + count, background.begin());
  first_px = s_px(skipped);
  count -= skipped;
}

bool sample_profile(const LightWindow& picture, const LightWindow& plate,
                    const Eigen::Vector2d& at_px, const Eigen::Vector2d& normal_px,
                    double inside_px, double outside_px, Profile& profile) {
  const int in = static_cast<int>(inside_px / Profile::kStepPx);
  const int out = static_cast<int>(outside_px / Profile::kStepPx);
  profile.count = std::min(in + out + 1, Profile::kMost);
  profile.first_px = -Profile::kStepPx * static_cast<float>(in);
  profile.plate = !plate.empty();
  const Eigen::Vector2d first = at_px + profile.first_px * normal_px;
  const Eigen::Vector2d last = at_px + profile.s_px(profile.count - 1) * normal_px;
  if (!picture.holds(first) || !picture.holds(last)) return false;
  const Eigen::Vector2f from = first.cast<float>();
  const Eigen::Vector2f step = (Profile::kStepPx * normal_px).cast<float>();
  for (int i = 0; i < profile.count; ++i) {
    const float x = from.x() + static_cast<float>(i) * step.x();
    const float y = from.y() + static_cast<float>(i) * step.y();
    profile.light[i] = picture.at(x, y);
    if (profile.plate) profile.background[i] = plate.at(x, y);
  }
  return true;
}

bool fit_edge(const Profile& profile, const EdgeModel& model, double start_px, double reach_px,
              int iterations, ProfileEdge& edge) {
  constexpr int kFewest = 6;
  constexpr double kSettledPx = 0.02;
  // Half-pixel samples of a bilinear picture: about every second one is independent.
  constexpr double kPerIndependent = 2.0;
  if (profile.count < kFewest) return false;
  double offset = start_px;
  LevelFit fit;
  OffsetStep step{};
  std::array<Step, Profile::kMost> steps;
  for (int i = 0; i < iterations; ++i) {
    if (!fit_levels(profile, model, static_cast<float>(offset), fit, steps)) return false;
    step = offset_step(profile, model, fit, steps);
    const double move =
        iterations > 1 ? std::clamp(step.step, -model.blur_px, model.blur_px) : step.step;
    offset += move;
    if (std::abs(offset - start_px) > reach_px) return false;
    if (std::abs(move) < kSettledPx) break;
  }
  if (!(step.information > 1e-9)) return false;
  const double freedom =
      std::max(1.0, profile.count / kPerIndependent - (model.slopes ? 5.0 : 3.0));
  // Quantisation alone leaves 1/sqrt(12) of a level.
  edge.freedom = freedom;
  // What is left after the last step, to first order; the levels were fitted before it.
  const double left = std::max(0.0, fit.square - step.step * step.step * step.information);
  edge.square = left / kPerIndependent;
  const double noise2 = std::max(edge.square / freedom, 0.1);
  const double ground = model.plate ? profile.background_at(offset) : 1.0;
  edge.offset_px = offset;
  edge.noise = std::sqrt(noise2);
  edge.information = step.information / kPerIndependent;
  edge.variance_px2 = noise2 / edge.information;
  edge.inner = fit.levels[0] + fit.levels[2] * offset;
  edge.contrast = (fit.levels[1] + fit.levels[3] * offset) * ground - edge.inner;
  edge.gain =
      0.5 * freedom *
      std::log((square_without_edge(profile, model.plate) / kPerIndependent + freedom * 0.1) /
               (edge.square + freedom * 0.1));
  return true;
}

bool plate_explains(const Profile& profile, double from_px) {
  if (!profile.plate) return false;
  double n = 0, b = 0, bb = 0, i = 0, ii = 0, bi = 0;
  for (int j = 0; j < profile.count; ++j) {
    if (profile.s_px(j) < from_px) continue;
    const double light = profile.light[j], ground = profile.background[j];
    n += 1, b += ground, bb += ground * ground, i += light, ii += light * light,
        bi += light * ground;
  }
  if (n < 2.0 || !(bb > 0.0)) return false;
  return ii - bi * bi / bb < ii - i * i / n;
}

}  // namespace trochoid::tracking
