#include "robust_step.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace trochoid::tracking {
namespace {

// Unknowns: the pose, the two nuisances common to the outline, and per group the error of the edge
// model as a function of direction, given at kKnots directions and blended between them.
constexpr int kCommon = 5, kKnots = 8;
constexpr int kMost = PoseMotion::kMost + kCommon + kGroups * kKnots;
constexpr int kRow = PoseMotion::kMost + kCommon + 2;
using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMost, kMost>;
using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMost, 1>;

// The rim may be a little larger or smaller than the caliper says, edges a little towards the
// bright side of where the transfer curve puts them.
constexpr double kSwellSdPx = 0.3;
constexpr double kPolaritySdPx = 0.2;
// The colour planes: towards the brighter side, and as a whole beyond half a pixel of the other
// common place of the samples.
constexpr double kColourPolaritySdPx = 0.3, kColourShiftSdPx = 0.08;

// The few unknowns an equation depends on.
struct Row {
  std::array<int, kRow> index;
  std::array<double, kRow> value;
  int count = 0;

  explicit Row(const EdgeEquation& e) {
    const int n = static_cast<int>(e.motion.size());
    for (int i = 0; i < n; ++i) add(i, e.motion[i]);
    add(n, e.swell);
    if (e.colour) {
      add(n + 2, e.polarity);
      add(n + 3, std::cos(e.direction_rad));
      add(n + 4, std::sin(e.direction_rad));
    } else {
      add(n + 1, e.polarity);
    }
    // Cosine and sine keep the variance the same between the knots.
    const double place = (e.direction_rad / (2.0 * std::numbers::pi) + 1.0) * kKnots;
    const int knot = static_cast<int>(place);
    const double part = 0.5 * std::numbers::pi * (place - knot);
    const int first = n + kCommon + e.group * kKnots;
    add(first + knot % kKnots, e.model_px * std::cos(part));
    add(first + (knot + 1) % kKnots, e.model_px * std::sin(part));
  }
  void add(int i, double v) {
    index[static_cast<size_t>(count)] = i;
    value[static_cast<size_t>(count)] = v;
    ++count;
  }
  [[nodiscard]] double dot(const Vector& x) const {
    double sum = 0.0;
    for (int k = 0; k < count; ++k)
      sum += value[static_cast<size_t>(k)] * x[index[static_cast<size_t>(k)]];
    return sum;
  }
  // Adds weight * row^T row to the lower triangle, weight * row * offset to the right side.
  void accumulate(double weight, double offset, Matrix& information, Vector& right) const {
    for (int a = 0; a < count; ++a) {
      const int i = index[static_cast<size_t>(a)];
      const double w = weight * value[static_cast<size_t>(a)];
      right[i] += w * offset;
      for (int b = 0; b < count; ++b)
        if (const int j = index[static_cast<size_t>(b)]; j <= i)
          information(i, j) += w * value[static_cast<size_t>(b)];
    }
  }
};

double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Matrix prior_information(const PoseMotion::Step& prior_sd) {
  const auto n = prior_sd.size();
  const auto size = n + kCommon + kGroups * kKnots;
  Matrix information = Matrix::Identity(size, size);
  for (int i = 0; i < n; ++i) information(i, i) = 1.0 / (prior_sd[i] * prior_sd[i]);
  information(n, n) = 1.0 / (kSwellSdPx * kSwellSdPx);
  information(n + 1, n + 1) = 1.0 / (kPolaritySdPx * kPolaritySdPx);
  information(n + 2, n + 2) = 1.0 / (kColourPolaritySdPx * kColourPolaritySdPx);
  information(n + 3, n + 3) = information(n + 4, n + 4) =
      1.0 / (kColourShiftSdPx * kColourShiftSdPx);
  return information;
}

// Errors of neighbouring edges are correlated (texture, relief, compression). Sums over blocks of
// the outline show by how much the variance of a sum exceeds that of independent errors; the fit
// itself takes `fitted` degrees of freedom out of the blocks.
double correlation_factor(const std::vector<EdgeEquation>& equations, double scale2,
                          double fitted) {
  constexpr double kBlocks = 32.0;
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
  const double freedom = std::max(0.3 * blocks, blocks - fitted);
  return std::max(1.0, observed / std::max(independent, 1e-30) * blocks / freedom);
}

// What whole stretches of the outline do to the answer: how far it moves when one sixth of all
// directions is left out, over what the covariance expects. Sees errors that neighbours share,
// whatever their cause.
double jackknife_ratio(const std::vector<EdgeEquation>& equations, const std::vector<Row>& rows,
                       const Matrix& prior, double scale, const Eigen::MatrixXd& covariance) {
  constexpr int kSectors = 6;
  const auto size = prior.rows();
  const auto n = covariance.rows();
  std::array<Matrix, kSectors> information;
  std::array<Vector, kSectors> right;
  Matrix all = prior;
  Vector all_right = Vector::Zero(size);
  for (size_t k = 0; k < kSectors; ++k)
    information[k] = Matrix::Zero(size, size), right[k] = Vector::Zero(size);
  for (size_t i = 0; i < equations.size(); ++i) {
    const EdgeEquation& e = equations[i];
    const double turn = e.direction_rad / (2.0 * std::numbers::pi) + 1.0;
    const auto sector = static_cast<size_t>(turn * kSectors) % kSectors;
    rows[i].accumulate(e.weight / (e.variance_px2 * scale * scale), e.offset_px,
                       information[sector], right[sector]);
  }
  for (size_t k = 0; k < kSectors; ++k) all += information[k], all_right += right[k];
  Eigen::MatrixXd answers(n, kSectors);
  for (size_t k = 0; k < kSectors; ++k) {
    const Matrix rest = all - information[k];
    answers.col(static_cast<Eigen::Index>(k)) =
        rest.ldlt().solve(Vector(all_right - right[k])).head(n);
  }
  const Eigen::VectorXd mean = answers.rowwise().mean();
  const Eigen::MatrixXd off = answers.colwise() - mean;
  const Eigen::MatrixXd variance = (kSectors - 1.0) / kSectors * off * off.transpose();
  return covariance.ldlt().solve(variance).trace() / static_cast<double>(n);
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
  const auto size = prior.rows();
  std::vector<Row> rows(equations.begin(), equations.end());
  Vector x = Vector::Zero(size);
  Matrix information;
  double scale = 1.0;
  std::vector<double> sizes(equations.size());
  Eigen::LDLT<Matrix> factor;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    for (size_t i = 0; i < equations.size(); ++i) {
      auto& e = equations[i];
      e.residual_px = e.offset_px - rows[i].dot(x);
      sizes[i] = std::abs(e.residual_px) / std::sqrt(e.variance_px2);
    }
    std::vector<double> copy = sizes;
    // Never below what the edges claim.
    scale = std::max(1.4826 * median(copy), 1.0);
    information = prior;
    Vector right = Vector::Zero(size);
    for (size_t i = 0; i < equations.size(); ++i) {
      auto& e = equations[i];
      const double bound = kTukey * std::max(scale, least_scale_px / std::sqrt(e.variance_px2));
      const double t = sizes[i] / bound;
      e.weight = t < 1.0 ? (1.0 - t * t) * (1.0 - t * t) : 0.0;
      rows[i].accumulate(e.weight / (e.variance_px2 * scale * scale), e.offset_px, information,
                         right);
    }
    factor.compute(information);
    const Vector next = factor.solve(right);
    if (!next.allFinite()) return false;
    const double change =
        (next - x).head(n).cwiseProduct(information.diagonal().head(n).cwiseSqrt()).norm();
    x = next;
    if (change < 0.02) break;  // in standard deviations
  }
  double square = 0.0, weight = 0.0, arc = 0.0, accepted = 0.0, z2 = 0.0;
  for (size_t i = 0; i < equations.size(); ++i) {
    auto& e = equations[i];
    e.residual_px = e.offset_px - rows[i].dot(x);
    square += e.weight * e.residual_px * e.residual_px;
    z2 += e.weight * e.residual_px * e.residual_px / e.variance_px2;
    weight += e.weight;
    arc += e.arc_px;
    if (e.weight > 0.5) accepted += e.arc_px;
  }
  if (!(weight > 0.0)) return false;
  const double scale2 = std::max(z2 / weight, 1.0);
  const Matrix inverse = factor.solve(Matrix::Identity(size, size));
  // Of each unknown the share that the edges determine and not the prior.
  double fitted = 0.0;
  for (int i = 0; i < size; ++i) fitted += 1.0 - prior(i, i) * inverse(i, i);
  out.step = x.head(n);
  out.swell_px = x[n];
  out.polarity_px = x[n + 1];
  out.colour_shift_px = {x[n + 3], x[n + 4]};
  out.rms_px = std::sqrt(square / weight);
  out.accepted = accepted / arc;
  out.correlation = correlation_factor(equations, scale2, fitted);
  // Noise grows with the correlation, what the edge models may be wrong by does not.
  const double inflation = out.correlation * scale2 / (scale * scale);
  out.covariance = inflation * inverse.topLeftCorner(n, n);
  // The sixths share some of their errors, so that the ratio is a little low; a small one may also
  // be luck.
  constexpr double kShared = 1.3, kLeast = 0.6, kMostInflated = 25.0;
  const double ratio = jackknife_ratio(equations, rows, prior, scale, out.covariance);
  if (std::isfinite(ratio)) out.covariance *= std::clamp(kShared * ratio, kLeast, kMostInflated);
  return true;
}

}  // namespace trochoid::tracking
