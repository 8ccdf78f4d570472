#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace trochoid::tracking {

/// Slope inside and outside of an edge, bend inside and outside, by how much a strip at the edge
/// differs from the rest of the body; here each over the most it can be.
inline constexpr int kShading = 5;
using Shading = Eigen::Matrix<double, kShading, 1>;
using ShadingMatrix = Eigen::Matrix<double, kShading, kShading>;

/// What one look at an outline says about the shading beside it: normal equations, over the
/// variance of the noise.
struct ShadingEvidence {
  bool usable = false;
  ShadingMatrix normal = ShadingMatrix::Zero();
  Shading right = Shading::Zero();
  int curve = 0;  ///< looks of one curve follow each other
};

struct ShadingEstimate {
  Shading shading = Shading::Zero();
  ShadingMatrix covariance = ShadingMatrix::Zero();
  /// 0..1: mean variance that slopes and bends seem to have, 0 where none shows.
  double unevenness = 1.0;
};

/// With every look's shading drawn about zero with this variance.
[[nodiscard]] std::vector<ShadingEstimate> shadings_given(const std::vector<ShadingEvidence>& looks,
                                                          double variance);

/// Shading beside all looks of an outline, by empirical Bayes: each is drawn about zero with the
/// variance that its neighbours along the curve show (method of moments, at most one). On plain
/// surfaces that is next to nothing, and with it what free shading costs; beside shadows, relief
/// and texture shading is as free as it is large.
[[nodiscard]] std::vector<ShadingEstimate> estimate_shadings(
    const std::vector<ShadingEvidence>& looks);

}  // namespace trochoid::tracking
