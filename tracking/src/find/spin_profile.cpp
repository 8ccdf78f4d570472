#include "find/spin_profile.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>

#include "geometry/bilinear.hpp"
#include "trochoid/data/angle.hpp"

namespace trochoid::tracking {
namespace {

constexpr int kRings = 8, kSpokes = 240;
constexpr double kInnermost = 0.22, kOutermost = 0.86;  // of the rim: the edge itself is left out

constexpr double kSpoke_rad = data::kTurn / kSpokes;

double ring_radius(int ring) {
  return kInnermost + (kOutermost - kInnermost) * ring / (kRings - 1);
}

float median_of(const float* begin, int count) {
  std::array<float, kSpokes> copy;
  std::copy(begin, begin + count, copy.begin());
  std::nth_element(copy.begin(), copy.begin() + count / 2, copy.begin() + count);
  return copy[static_cast<std::size_t>(count / 2)];
}

/// Takes the level out of a ring, and the shading: it stays with the lamp while the marks turn.
/// What changes over more than a quarter of the turn counts as shading, its marks cut off.
void flatten(float* row) {
  constexpr int kReach = kSpokes / 8;
  const float level = median_of(row, kSpokes);
  std::array<float, kSpokes> size;
  for (int i = 0; i < kSpokes; ++i) {
    row[i] -= level;
    size[static_cast<std::size_t>(i)] = std::abs(row[i]);
  }
  const float most = 2.0F * median_of(size.data(), kSpokes);
  std::array<float, kSpokes> shade;
  float sum = 0.0F;
  const auto cut = [&](int i) { return std::clamp(row[(i + kSpokes) % kSpokes], -most, most); };
  for (int i = -kReach; i <= kReach; ++i) sum += cut(i);
  for (int i = 0; i < kSpokes; ++i) {
    shade[static_cast<std::size_t>(i)] = sum / (2 * kReach + 1);
    sum += cut(i + kReach + 1) - cut(i - kReach);
  }
  for (int i = 0; i < kSpokes; ++i) row[i] -= shade[static_cast<std::size_t>(i)];
}

}  // namespace

SpinProfile::Polar SpinProfile::unroll(const cv::Mat& luma, const Ellipse& rim) {
  Polar polar(static_cast<std::size_t>(kRings * kSpokes));
  static const auto kDirections = [] {
    std::array<Eigen::Vector2d, kSpokes> d;
    for (int i = 0; i < kSpokes; ++i)
      d[static_cast<std::size_t>(i)] = {std::cos(kSpoke_rad * i), std::sin(kSpoke_rad * i)};
    return d;
  }();
  for (int ring = 0; ring < kRings; ++ring) {
    float* row = polar.data() + ring * kSpokes;
    // All of the ring's width: a mark smaller than that must not fall between two.
    constexpr int kAcross = 3;
    for (int k = 0; k < kAcross; ++k) {
      const double part = (k + 0.5) / kAcross - 0.5;
      const Eigen::Matrix2d shape =
          (ring_radius(ring) + part * (kOutermost - kInnermost) / (kRings - 1)) * rim.shape_px;
      for (std::size_t i = 0; i < kSpokes; ++i) {
        const Eigen::Vector2d p = rim.centre_px + shape * kDirections[i];
        row[i] += bilinear_inside<float>(luma, p.x(), p.y()) / kAcross;
      }
    }
    flatten(row);
  }
  return polar;
}

void SpinProfile::cut(Polar& polar) const {
  for (float& v : polar) {
    const float size = std::abs(v) - threshold_;
    v = size > 0.0F ? std::copysign(size, v) : 0.0F;
  }
}

std::optional<SpinProfile> SpinProfile::from_face(const cv::Mat& luma, const Ellipse& rim,
                                                  double noise_levels) {
  SpinProfile profile;
  profile.noise_ = noise_levels;
  profile.reference_ = unroll(luma, rim);
  std::vector<float> size;
  for (const float v : profile.reference_) size.push_back(std::abs(v));
  std::sort(size.begin(), size.end());
  // Even a small mark holds a few samples; brighter or darker single ones are noise.
  constexpr std::size_t kFew = 6;
  const float strongest = size[size.size() - kFew];
  if (strongest < std::max(15.0, 6.0 * noise_levels)) return std::nullopt;
  profile.threshold_ = 0.35F * strongest;  // shading moves with the light, not with the face
  profile.cut(profile.reference_);
  for (int ring = 0; ring < kRings; ++ring)
    for (int i = 0; i < kSpokes; ++i) {
      const float* row = profile.reference_.data() + ring * kSpokes;
      const float slope = (row[(i + 1) % kSpokes] - row[(i + kSpokes - 1) % kSpokes]) /
                          static_cast<float>(2.0 * kSpoke_rad);
      profile.slope_power_ += slope * slope;
      profile.power_ += row[i] * row[i];
    }
  if (profile.power_ <= 0.0F || profile.slope_power_ <= 0.0F) return std::nullopt;
  const double face_px =
      data::kPi * rim.shape_px.determinant() * (kOutermost * kOutermost - kInnermost * kInnermost);
  profile.independent_share_ = std::min(1.0, face_px / (kRings * kSpokes));
  profile.orient();
  return profile;
}

/// Direction of the marks: phase of the first circular harmonic of where the marks are, or of the
/// second where the face repeats after half a turn.
void SpinProfile::orient() {
  const float half_turn = correlation(reference_, kSpokes / 2) / power_;
  two_fold_ = half_turn > 0.5F;
  const int order = two_fold_ ? 2 : 1;
  std::complex<double> sum = 0.0;
  for (int ring = 0; ring < kRings; ++ring)
    for (int i = 0; i < kSpokes; ++i)
      sum += ring_radius(ring) *
             std::abs(reference_[static_cast<std::size_t>(ring * kSpokes + i)]) *
             std::polar(1.0, order * kSpoke_rad * i);
  reference_angle_ = std::arg(sum) / order;
}

float SpinProfile::correlation(const Polar& polar, int shift) const {
  const int s = ((shift % kSpokes) + kSpokes) % kSpokes;
  float sum = 0.0F;
  for (int ring = 0; ring < kRings; ++ring) {
    const float* a = reference_.data() + ring * kSpokes;
    const float* b = polar.data() + ring * kSpokes;
    for (int i = 0; i < kSpokes - s; ++i) sum += a[i] * b[i + s];
    for (int i = kSpokes - s; i < kSpokes; ++i) sum += a[i] * b[i + s - kSpokes];
  }
  return sum;
}

std::optional<ImageAngle> SpinProfile::read(const cv::Mat& luma, const Ellipse& rim,
                                            double predicted_rad, double window_rad) const {
  Polar polar = unroll(luma, rim);
  cut(polar);
  float power = 0.0F;
  for (const float v : polar) power += v * v;
  if (power <= 0.0F) return std::nullopt;
  const int middle = static_cast<int>(std::lround(predicted_rad / kSpoke_rad));
  const int reach = std::clamp(static_cast<int>(window_rad / kSpoke_rad), 2, kSpokes / 2);
  std::vector<float> score;
  for (int s = middle - reach - 1; s <= middle + reach + 1; ++s)
    score.push_back(correlation(polar, s));
  const auto best = std::max_element(score.begin() + 1, score.end() - 1);
  const float before = *(best - 1), at = *best, after = *(best + 1);
  if (at < before || at < after) return std::nullopt;  // the summit lies outside the window
  const float bend = before - 2 * at + after;
  const double fine = bend < 0.0F ? 0.5 * (before - after) / bend : 0.0;
  ImageAngle angle;
  angle.angle_rad =
      (static_cast<double>(middle - reach - 1 + (best - score.begin())) + fine) * kSpoke_rad;
  angle.correlation = at / std::sqrt(power * power_);
  if (angle.correlation < 0.5) return std::nullopt;
  // Noise of all samples against the slope of the reference; what is not alike counts as noise too.
  const double unlike = (1.0 - angle.correlation * angle.correlation) * power_ / (kRings * kSpokes);
  const double variance = (noise_ * noise_ + unlike) / (slope_power_ * independent_share_);
  angle.sigma_rad = std::max(std::sqrt(variance), 1e-3);
  return angle;
}

}  // namespace trochoid::tracking
