#pragma once
#include <Eigen/Core>
#include <optional>

#include "trochoid/data/scene.hpp"

/// Independent reference solutions for the studies: other equations (vectors instead of angles),
/// another method (extrapolation) and longer numbers (80 bits) than the models use.
namespace trochoid::tools {

/// Where a body is and points on a time grid.
struct ReferenceRun {
  Eigen::VectorXd t_s;
  Eigen::MatrixX3d axis;  ///< symmetry axis k in the table frame (z body axis of a free body)
  Eigen::MatrixX2d xy_m;  ///< CoM
  /// Largest distance between this run and one whose start differs by `kNudge`, over kNudge: how
  /// much any error made on the way is amplified.
  double growth = 1.0;
};

/// Runs the scene's free, top, rolling or regularised sliding model on its own grid. Loss terms
/// known here: top drag, linear air couples, sliding friction.
/// @returns nothing for a scene with other terms, or whose motion leaves the model before the end.
[[nodiscard]] std::optional<ReferenceRun> high_precision_run(const data::Scene& scene);

}  // namespace trochoid::tools
