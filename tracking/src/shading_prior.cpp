#include "shading_prior.hpp"

#include <Eigen/Cholesky>
#include <algorithm>

namespace trochoid::tracking {
namespace {

// The least allows for what the model of an edge leaves that is no shading: pixels, compression.
constexpr double kLeastVariance = 0.03, kMostVariance = 1.0;

// Minimises x^T A x / 2 - b^T x over 0 <= x <= kMostVariance, A positive semidefinite, one
// coordinate at a time.
Shading least_within_bounds(const ShadingMatrix& A, const Shading& b) {
  constexpr int kSweeps = 12;
  Shading x = Shading::Zero();
  for (int sweep = 0; sweep < kSweeps; ++sweep)
    for (int k = 0; k < kShading; ++k) {
      if (!(A(k, k) > 0.0)) continue;
      const double rest = b[k] - A.row(k).dot(x) + A(k, k) * x[k];
      x[k] = std::clamp(rest / A(k, k), 0.0, kMostVariance);
    }
  return x;
}

// With shading s of diagonal covariance V, right sides r = N s + noise have E[r_k^2] =
// sum_l N_kl^2 V_l + N_kk: sums of both sides over some looks.
struct Moments {
  ShadingMatrix squares = ShadingMatrix::Zero();
  Shading excess = Shading::Zero();

  void add(const ShadingEvidence& look, double sign) {
    squares += sign * look.normal.cwiseAbs2();
    excess += sign * (look.right.cwiseAbs2() - look.normal.diagonal());
  }
  [[nodiscard]] Shading variances() const { return least_within_bounds(squares, excess); }
};

// A strip along the edge, the wall of the body mostly, is lit like nothing else.
ShadingEstimate estimate(const ShadingEvidence& look, const Shading& seen_variance) {
  Shading variance = seen_variance.cwiseMax(kLeastVariance);
  variance[kShading - 1] = kMostVariance;
  ShadingMatrix information = look.normal;
  information.diagonal() += variance.cwiseInverse();
  ShadingEstimate out;
  out.covariance = Eigen::LLT<ShadingMatrix>(information).solve(ShadingMatrix::Identity());
  out.shading = out.covariance * look.right;
  out.unevenness = seen_variance.head<kShading - 1>().mean();
  return out;
}

}  // namespace

std::vector<ShadingEstimate> shadings_given(const std::vector<ShadingEvidence>& looks,
                                            double variance) {
  std::vector<ShadingEstimate> out(looks.size());
  for (std::size_t i = 0; i < looks.size(); ++i)
    if (looks[i].usable) out[i] = estimate(looks[i], Shading::Constant(variance));
  return out;
}

std::vector<ShadingEstimate> estimate_shadings(const std::vector<ShadingEvidence>& looks) {
  constexpr std::size_t kLeastReach = 8;
  constexpr double kShare = 0.12;  // of the curve to either side
  std::vector<ShadingEstimate> out(looks.size());
  for (std::size_t first = 0, end = 0; first < looks.size(); first = end) {
    while (end < looks.size() && looks[end].curve == looks[first].curve) ++end;
    const auto share = static_cast<std::size_t>(kShare * static_cast<double>(end - first));
    const std::size_t reach = std::max(kLeastReach, share);
    Moments around;
    const auto add = [&](std::size_t i, double sign) {
      if (looks[i].usable) around.add(looks[i], sign);
    };
    for (std::size_t i = first; i < std::min(end, first + reach); ++i) add(i, 1.0);
    for (std::size_t i = first; i < end; ++i) {
      if (i + reach < end) add(i + reach, 1.0);
      if (i > first + reach) add(i - reach - 1, -1.0);
      if (looks[i].usable) out[i] = estimate(looks[i], around.variances());
    }
  }
  return out;
}

}  // namespace trochoid::tracking
