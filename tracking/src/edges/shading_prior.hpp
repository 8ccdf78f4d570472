#pragma once
#include <Eigen/Core>
#include <array>
#include <map>
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
  int curve = 0;               ///< looks of one curve follow each other
  double direction_rad = 0.0;  ///< of the normal, in the picture
};

/// Slopes of the light beside each curve of an outline by direction in the picture, as a few frames
/// show them: the light stays where it is while the body turns under it, and one frame alone tells
/// slopes from noise only where they are large. (Bends are left to each frame: what looks bent in
/// all of them may be the lens.)
class ShadingMemory {
 public:
  void add(const ShadingEvidence& look);
  void add(const ShadingMemory& other);
  /// What a look at a curve is expected to show; zero where nothing is known.
  [[nodiscard]] Shading expected(int curve, double direction_rad) const;
  [[nodiscard]] bool empty() const { return curves_.empty(); }

 private:
  static constexpr int kSectors = 24;
  struct Sector {
    Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    [[nodiscard]] Eigen::Vector2d slopes() const;
  };
  std::map<int, std::array<Sector, kSectors>> curves_;
};

struct ShadingEstimate {
  Shading shading = Shading::Zero();
  ShadingMatrix covariance = ShadingMatrix::Zero();
  /// 0..1: mean variance that slopes and bends seem to have, 0 where none shows.
  double unevenness = 1.0;
};

/// With every look's slopes and bends drawn about zero with this variance; strips as free as ever.
[[nodiscard]] std::vector<ShadingEstimate> shadings_given(const std::vector<ShadingEvidence>& looks,
                                                          double variance);

/// Shading beside all looks of an outline, by empirical Bayes: each is drawn about what is known of
/// it with the variance that its neighbours along the curve show (method of moments, at most one).
/// On plain surfaces that is next to nothing, and with it what free shading costs; beside shadows,
/// relief and texture shading is as free as it is large.
/// @param expected of each look, ShadingMemory::expected; empty: nothing is known.
[[nodiscard]] std::vector<ShadingEstimate> estimate_shadings(
    const std::vector<ShadingEvidence>& looks, const std::vector<Shading>& expected);

}  // namespace trochoid::tracking
