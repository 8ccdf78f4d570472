#include "robust_step.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace trochoid::tracking {
namespace {

constexpr int kNuisances = 2;
constexpr int kMost = PoseMotion::kMost + kNuisances;
using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMost, kMost>;
using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMost, 1>;

// The rim may be a little larger or smaller than the caliper says, edges a little towards the
// bright side of where the transfer curve and the floor's own shading put them.
constexpr double kSwellSdPx = 0.05;
constexpr double kPolaritySdPx = 0.05;

Vector row_of(const EdgeEquation& e) {
  Vector row(e.motion.size() + kNuisances);
  row.head(e.motion.size()) = e.motion;
  row[e.motion.size()] = e.swell;
  row[e.motion.size() + 1] = e.polarity;
  return row;
}

double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Matrix prior_information(const PoseMotion::Step& prior_sd) {
  const auto n = prior_sd.size();
  Matrix information = Matrix::Zero(n + kNuisances, n + kNuisances);
  for (int i = 0; i < n; ++i) information(i, i) = 1.0 / (prior_sd[i] * prior_sd[i]);
  information(n, n) = 1.0 / (kSwellSdPx * kSwellSdPx);
  information(n + 1, n + 1) = 1.0 / (kPolaritySdPx * kPolaritySdPx);
  return information;
}

// Errors of neighbouring edges are correlated (texture, shading, compression). Sums over blocks of
// the outline show by how much the variance of a sum exceeds that of independent errors; the fit
// itself takes a few degrees of freedom out of the blocks.
double correlation_factor(const std::vector<EdgeEquation>& equations, double scale2,
                          int parameters) {
  constexpr double kBlocks = 24.0;
  double total_arc = 0.0;
  for (const auto& e : equations) total_arc += e.arc_px;
  const double block_arc = total_arc / kBlocks;
  double observed = 0.0, independent = 0.0, arc = 0.0, sum = 0.0, variance = 0.0;
  int blocks = 0, curve = equations.front().curve;
  const auto close = [&] {
    if (variance > 0.0) observed += sum * sum, independent += variance, ++blocks;
    arc = sum = variance = 0.0;
  };
  for (const auto& e : equations) {
    if (e.curve != curve || arc + 0.5 * e.arc_px > block_arc) close();
    curve = e.curve;
    const double w = e.weight / e.variance_px2;
    sum += w * e.residual_px;
    variance += w * w * e.variance_px2 * scale2;
    arc += e.arc_px;
  }
  close();
  const double freedom = std::max(1.0, blocks - static_cast<double>(parameters));
  return std::max(1.0, observed / std::max(independent, 1e-30) * blocks / freedom);
}

}  // namespace

bool solve_robustly(std::vector<EdgeEquation>& equations, const PoseMotion::Step& prior_sd,
                    double least_scale_px, RobustSolution& out) {
  constexpr size_t kFewest = 8;
  constexpr int kIterations = 8;
  constexpr double kTukey = 4.685;  // 95 % efficiency for normal errors
  if (equations.size() < kFewest) return false;
  const auto n = prior_sd.size();
  const Matrix prior = prior_information(prior_sd);
  Vector x = Vector::Zero(n + kNuisances);
  Matrix information;
  double scale = 1.0;
  std::vector<double> sizes(equations.size());
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    for (size_t i = 0; i < equations.size(); ++i) {
      auto& e = equations[i];
      e.residual_px = e.offset_px - row_of(e).dot(x);
      sizes[i] = std::abs(e.residual_px) / std::sqrt(e.variance_px2);
    }
    std::vector<double> copy = sizes;
    // Never below what the edges claim: their variances hold what does not average out.
    scale = std::max(1.4826 * median(copy), 1.0);
    information = prior;
    Vector right = Vector::Zero(n + kNuisances);
    for (size_t i = 0; i < equations.size(); ++i) {
      auto& e = equations[i];
      const double bound = kTukey * std::max(scale, least_scale_px / std::sqrt(e.variance_px2));
      const double t = sizes[i] / bound;
      e.weight = t < 1.0 ? (1.0 - t * t) * (1.0 - t * t) : 0.0;
      const double w = e.weight / (e.variance_px2 * scale * scale);
      const Vector row = row_of(e);
      information.noalias() += w * row * row.transpose();
      right.noalias() += w * row * e.offset_px;
    }
    const Vector next = information.ldlt().solve(right);
    if (!next.allFinite()) return false;
    const double change = (next - x).cwiseProduct(information.diagonal().cwiseSqrt()).norm();
    x = next;
    if (change < 0.02) break;  // in standard deviations
  }
  double square = 0.0, weight = 0.0, arc = 0.0, accepted = 0.0, z2 = 0.0;
  for (auto& e : equations) {
    e.residual_px = e.offset_px - row_of(e).dot(x);
    square += e.weight * e.residual_px * e.residual_px;
    z2 += e.weight * e.residual_px * e.residual_px / e.variance_px2;
    weight += e.weight;
    arc += e.arc_px;
    if (e.weight > 0.5) accepted += e.arc_px;
  }
  if (!(weight > 0.0)) return false;
  const double scale2 = std::max(z2 / weight, 1.0);
  out.step = x.head(n);
  out.swell_px = x[n];
  out.polarity_px = x[n + 1];
  out.rms_px = std::sqrt(square / weight);
  out.accepted = accepted / arc;
  out.correlation = correlation_factor(equations, scale2, static_cast<int>(n) + kNuisances);
  const Matrix inverse = information.ldlt().solve(Matrix::Identity(n + kNuisances, n + kNuisances));
  const double inflation = out.correlation * scale2 / (scale * scale);
  out.covariance = inflation * inverse.topLeftCorner(n, n);
  return true;
}

}  // namespace trochoid::tracking
