#include "find/rim_fit.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/bilinear.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {
namespace {

constexpr double kStep_px = 0.5;  // along a normal
constexpr double kTukey = 4.0;    // rejection point in robust sigmas
constexpr int kLevelSamples = 5;  // samples (2 px) that make the level beside an edge
constexpr int kLevelGap = 3;      // samples (1.5 px) left out at the edge: optics and codec blur

/// A point where a normal of the rim crosses an edge.
struct RimEdge {
  Eigen::Vector2d point_px, normal;
  double sigma_px = 0.0;
  double step_levels = 0.0;  ///< inside minus outside
  double weight = 0.0;
  double residual_px = 0.0;
  bool in_background = false;  ///< the static scene has an edge there as well
};

/// The edge along one normal: the strongest gradient near the start, refined to the crossing of the
/// half level between what lies inside and outside of it.
class NormalScan {
 public:
  NormalScan(const cv::Mat& luma, const RimSearch& search)
      : luma_(luma),
        search_(search),
        half_(static_cast<int>(std::ceil(search.reach_px / kStep_px))) {
    margin_ = kLevelGap + kLevelSamples;
    profile_.resize(static_cast<std::size_t>(2 * (half_ + margin_) + 1));
  }

  [[nodiscard]] std::optional<RimEdge> find(const Eigen::Vector2d& at,
                                            const Eigen::Vector2d& normal) {
    if (!read(at, normal)) return std::nullopt;
    const int best = strongest();
    if (best < 0) return std::nullopt;
    return refine(best, at, normal);
  }

 private:
  bool read(const Eigen::Vector2d& at, const Eigen::Vector2d& normal) {
    const int n = half_ + margin_;
    const Eigen::Vector2d a = at - n * kStep_px * normal, b = at + n * kStep_px * normal;
    const double right = luma_.cols - 1.001, bottom = luma_.rows - 1.001;
    for (const Eigen::Vector2d& p : {a, b})
      if (!(p.x() >= 0 && p.y() >= 0 && p.x() <= right && p.y() <= bottom)) return false;
    for (int i = -n; i <= n; ++i) {
      const Eigen::Vector2d p = at + i * kStep_px * normal;
      profile_[static_cast<std::size_t>(i + n)] = bilinear<double>(luma_, p.x(), p.y());
    }
    return true;
  }

  /// Index of the strongest step, distance from the start counting against it; -1 if none stands
  /// out of the noise.
  [[nodiscard]] int strongest() const {
    const double floor = std::max(5.0, 3.0 * search_.noise_levels);
    double best_score = 0.0;
    int best = -1;
    for (int i = margin_; i <= margin_ + 2 * half_; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const double step = std::abs(profile_[k + 2] - profile_[k - 2]);
      const double offset = (i - margin_ - half_) * kStep_px / search_.reach_px;
      const double score = step * (1.0 - 0.5 * offset * offset);
      if (step > floor && score > best_score) best_score = score, best = i;
    }
    return best;
  }

  [[nodiscard]] std::optional<RimEdge> refine(int i, const Eigen::Vector2d& at,
                                              const Eigen::Vector2d& normal) const {
    double inside = 0.0, outside = 0.0;
    for (int k = 0; k < kLevelSamples; ++k) {
      inside += profile_[static_cast<std::size_t>(i - kLevelGap - k)];
      outside += profile_[static_cast<std::size_t>(i + kLevelGap + k)];
    }
    inside /= kLevelSamples;
    outside /= kLevelSamples;
    const double step = inside - outside, half = 0.5 * (inside + outside);
    if (std::abs(step) < std::max(6.0, 3.0 * search_.noise_levels)) return std::nullopt;
    double best = 1e9, slope = 0.0;
    for (int k = i - kLevelGap; k < i + kLevelGap; ++k) {
      const double a = profile_[static_cast<std::size_t>(k)] - half;
      const double b = profile_[static_cast<std::size_t>(k + 1)] - half;
      if ((a - b) * step <= 0.0 || a * b > 0.0) continue;
      const double crossing = k + a / (a - b);
      if (std::abs(crossing - i) < std::abs(best - i))
        best = crossing, slope = std::abs(a - b) / kStep_px;
    }
    if (best > 1e8) return std::nullopt;
    const double offset_px = (best - margin_ - half_) * kStep_px;
    const Eigen::Vector2d point = at + offset_px * normal;
    // Bilinear samples of white noise keep about 0.7 of its deviation.
    return RimEdge{.point_px = point,
                   .normal = normal,
                   .sigma_px = std::max(0.02, 0.7 * search_.noise_levels / slope),
                   .step_levels = step,
                   .in_background = scene_step(point, normal) > 0.4 * std::abs(step)};
  }

  /// Step of the static scene across the same place, 2 px to both sides.
  [[nodiscard]] double scene_step(const Eigen::Vector2d& at, const Eigen::Vector2d& normal) const {
    if (search_.background == nullptr) return 0.0;
    const Eigen::Vector2d a = at - 2.0 * normal, b = at + 2.0 * normal;
    return std::abs(bilinear<double>(*search_.background, a.x(), a.y()) -
                    bilinear<double>(*search_.background, b.x(), b.y()));
  }

  const cv::Mat& luma_;
  const RimSearch& search_;
  int half_, margin_ = 0;
  std::vector<double> profile_;
};

struct Rays {
  std::vector<RimEdge> edges;
  int asked = 0;
};

Rays find_edges(const cv::Mat& luma, const Ellipse& ellipse, const RimSearch& search) {
  const double perimeter = data::kPi * (ellipse.semi_major_px() + ellipse.semi_minor_px());
  const int count = std::clamp(static_cast<int>(perimeter / 1.5), 36, 144);
  const Eigen::Matrix2d inverse = ellipse.shape_px.inverse();
  NormalScan scan(luma, search);
  Rays rays{.edges = {}, .asked = count};
  for (int i = 0; i < count; ++i) {
    const double angle = data::kTurn * i / count;
    const Eigen::Vector2d u(std::cos(angle), std::sin(angle));
    const Eigen::Vector2d normal = (inverse * u).normalized();
    if (const auto edge = scan.find(ellipse.centre_px + ellipse.shape_px * u, normal))
      rays.edges.push_back(*edge);
  }
  return rays;
}

/// A rim has one polarity nearly everywhere; edges of the other sign are marks, floor and shadow,
/// unless both are common (a body of mixed brightness on a mixed floor).
void keep_common_polarity(std::vector<RimEdge>& edges) {
  const auto bright =
      std::count_if(edges.begin(), edges.end(), [](const RimEdge& e) { return e.step_levels > 0; });
  const double share = static_cast<double>(bright) / static_cast<double>(edges.size());
  if (share > 0.3 && share < 0.7) return;
  std::erase_if(edges, [&](const RimEdge& e) { return (e.step_levels > 0) != (share >= 0.5); });
}

/// Edges that the static scene shows too are not the body's, unless most are.
void drop_scene_edges(std::vector<RimEdge>& edges) {
  const auto scene =
      std::count_if(edges.begin(), edges.end(), [](const RimEdge& e) { return e.in_background; });
  if (static_cast<double>(scene) > 0.4 * static_cast<double>(edges.size())) return;
  std::erase_if(edges, [](const RimEdge& e) { return e.in_background; });
}

using Vector5 = Eigen::Matrix<double, 5, 1>;
using Matrix5 = Eigen::Matrix<double, 5, 5>;

/// Robust Gauss-Newton on the distance of the edges to the ellipse.
///   parameters: centre (2), m00, m01, m11 of the shape
class EllipseFit {
 public:
  EllipseFit(std::vector<RimEdge>& edges, Ellipse start, const RimSearch& search)
      : edges_(edges), ellipse_(std::move(start)), search_(search) {}

  bool solve() {
    for (int iteration = 0; iteration < 12; ++iteration) {
      if (!accumulate(iteration)) return false;
      const Vector5 step = normal_.ldlt().solve(gradient_);
      if (!step.allFinite()) return false;
      ellipse_.centre_px += step.head<2>();
      ellipse_.shape_px(0, 0) += step[2];
      ellipse_.shape_px(0, 1) += step[3];
      ellipse_.shape_px(1, 0) += step[3];
      ellipse_.shape_px(1, 1) += step[4];
      if (ellipse_.shape_px.determinant() < 1.0 || ellipse_.shape_px.trace() <= 0.0) return false;
      if (iteration > 2 && step.cwiseAbs().maxCoeff() < 2e-3) break;
    }
    return accumulate(12);
  }

  [[nodiscard]] const Ellipse& ellipse() const { return ellipse_; }
  [[nodiscard]] double scale_px() const { return scale_; }
  [[nodiscard]] Matrix5 inverse_normal() const { return normal_.inverse(); }

 private:
  /// Residuals, robust scale and weights, normal equations. False if the edges fix no ellipse.
  bool accumulate(int iteration) {
    const Eigen::Matrix2d inverse = ellipse_.shape_px.inverse();
    std::vector<Vector5> rows(edges_.size());
    std::vector<double> sizes(edges_.size());
    for (std::size_t i = 0; i < edges_.size(); ++i) {
      RimEdge& edge = edges_[i];
      const Eigen::Vector2d q = inverse * (edge.point_px - ellipse_.centre_px);
      const double length = std::max(q.norm(), 1e-6);
      const Eigen::Vector2d gradient = inverse * q / length;
      const Eigen::Vector2d n = gradient.normalized(), u = q / length;
      edge.residual_px = (length - 1.0) / gradient.norm();
      // Moving the centre by d moves the curve along n by n.d; changing the shape, by n^T dM u.
      rows[i] << n.x(), n.y(), n.x() * u.x(), n.x() * u.y() + n.y() * u.x(), n.y() * u.y();
      sizes[i] = std::abs(edge.residual_px);
    }
    // A wide scale at first: the start may be pixels off, and rejecting then keeps the wrong side.
    const double floor = iteration < 2 ? 0.5 * search_.reach_px / kTukey : 0.08;
    scale_ = std::max(data::kSdOverMedianDistance * data::median(sizes), floor);
    normal_.setZero();
    gradient_.setZero();
    int used = 0;
    for (std::size_t i = 0; i < edges_.size(); ++i) {
      const double z = edges_[i].residual_px / (kTukey * scale_);
      edges_[i].weight = std::abs(z) < 1.0 ? (1.0 - z * z) * (1.0 - z * z) : 0.0;
      if (edges_[i].weight <= 0.0) continue;
      const double w = edges_[i].weight / (scale_ * scale_);
      normal_ += w * rows[i] * rows[i].transpose();
      gradient_ += w * edges_[i].residual_px * rows[i];
      ++used;
    }
    add_shape_knowledge();
    return used >= 8 && normal_.allFinite();
  }

  void add_shape_knowledge() {
    if (!search_.known_shape_px) return;
    const double w = 1.0 / (search_.known_shape_sigma_px * search_.known_shape_sigma_px);
    const Eigen::Matrix2d off = *search_.known_shape_px - ellipse_.shape_px;
    const Eigen::Vector3d target(off(0, 0), off(0, 1), off(1, 1));
    for (int k = 0; k < 3; ++k) {
      normal_(2 + k, 2 + k) += w;
      gradient_[2 + k] += w * target[k];
    }
  }

  std::vector<RimEdge>& edges_;
  Ellipse ellipse_;
  const RimSearch& search_;
  Matrix5 normal_ = Matrix5::Zero();
  Vector5 gradient_ = Vector5::Zero();
  double scale_ = 1.0;
};

/// How many neighbours share one independent error: 1 + 2 sum of the residuals' autocorrelation
/// along the rim, up to its first zero. Shading and compression blocks make edges err together.
double correlation_inflation(const std::vector<RimEdge>& edges) {
  std::vector<double> r;
  for (const RimEdge& e : edges)
    if (e.weight > 0.1) r.push_back(e.residual_px);
  const auto n = static_cast<std::ptrdiff_t>(r.size());
  if (n < 12) return 2.0;
  double power = 0.0;
  for (const double v : r) power += v * v;
  double inflation = 1.0;
  for (std::ptrdiff_t lag = 1; lag < n / 4; ++lag) {
    double product = 0.0;
    for (std::ptrdiff_t i = 0; i < n; ++i)
      product += r[static_cast<std::size_t>(i)] * r[static_cast<std::size_t>((i + lag) % n)];
    const double rho = product / std::max(power, 1e-12);
    if (rho <= 0.0) break;
    inflation += 2.0 * rho;
  }
  return std::clamp(inflation, 1.0, 10.0);
}

RimFit report(const EllipseFit& fit, const std::vector<RimEdge>& edges, int asked) {
  RimFit result{.ellipse = fit.ellipse()};
  double sum = 0.0;
  for (const RimEdge& e : edges) {
    if (e.weight < 0.1) continue;
    sum += e.residual_px * e.residual_px;
    result.edges.push_back({e.point_px, e.normal, e.sigma_px, e.residual_px});
  }
  const auto used = static_cast<double>(result.edges.size());
  result.accepted = used / asked;
  result.rms_px = std::sqrt(sum / std::max(1.0, used - 5.0));
  // The normal matrix holds weight / scale^2; the spread seen replaces the scale, which has a
  // floor.
  const double spread = std::max(result.rms_px, 0.03) / fit.scale_px();
  const Matrix5 covariance = spread * spread * correlation_inflation(edges) * fit.inverse_normal();
  result.covariance_px2 = covariance.topLeftCorner<2, 2>();
  return result;
}

}  // namespace

Ellipse Ellipse::from_axes(const Eigen::Vector2d& centre_px, double semi_major_px,
                           double semi_minor_px, double angle_rad) {
  const Eigen::Vector2d along(std::cos(angle_rad), std::sin(angle_rad));
  const Eigen::Vector2d across(-along.y(), along.x());
  return {centre_px,
          semi_major_px * along * along.transpose() + semi_minor_px * across * across.transpose()};
}

double Ellipse::semi_major_px() const {
  const double mean = 0.5 * shape_px.trace();
  return mean + std::hypot(0.5 * (shape_px(0, 0) - shape_px(1, 1)), shape_px(0, 1));
}

double Ellipse::semi_minor_px() const {
  return shape_px.trace() - semi_major_px();
}

double Ellipse::angle_rad() const {
  return 0.5 * std::atan2(2.0 * shape_px(0, 1), shape_px(0, 0) - shape_px(1, 1));
}

std::optional<RimFit> fit_rim(const cv::Mat& luma, const Ellipse& start, const RimSearch& search) {
  Ellipse ellipse = start;
  RimSearch pass = search;
  std::optional<RimFit> result;
  for (int round = 0; round < 3; ++round) {
    Rays rays = find_edges(luma, ellipse, pass);
    if (rays.edges.size() < 12) return std::nullopt;
    keep_common_polarity(rays.edges);
    drop_scene_edges(rays.edges);
    if (rays.edges.size() < 12) return std::nullopt;
    EllipseFit fit(rays.edges, ellipse, pass);
    if (!fit.solve()) return std::nullopt;
    const double moved = (fit.ellipse().centre_px - ellipse.centre_px).norm();
    ellipse = fit.ellipse();
    if ((ellipse.centre_px - start.centre_px).norm() > search.reach_px + start.semi_minor_px())
      return std::nullopt;
    result = report(fit, rays.edges, rays.asked);
    if (round > 0 && moved < 0.02) break;
    pass.reach_px =
        std::clamp(4.0 * fit.scale_px(), std::min(2.5, search.reach_px), search.reach_px);
  }
  return result;
}

}  // namespace trochoid::tracking
