#pragma once
#include <map>
#include <string>
#include <vector>

#include "observations.hpp"

namespace trochoid::fitting {

/// Values by parameter name to start the minimiser from; `path` says where they came from.
struct Start {
  std::string path;
  std::map<std::string, double> values;
};

/// Starts for the heavy symmetric top (M2) from positions alone, best first.
///
/// With P = l k and L = angular momentum / I, P' = L x P and L' = (a/l) z x P. Integrated once,
///   X = X0 - Lz Int(Y) + Ly0 Int(Z) + (a/l) Int(Z Int(X)),
///   Y = Y0 + Lz Int(X) - Lx0 Int(Z) + (a/l) Int(Z Int(Y)),   Z = +-sqrt(l^2 - X^2 - Y^2),
/// which for a given l is linear in six unknowns and needs no derivative of noisy data: l is
/// scanned. Where the axis crosses the horizontal, the sign of Z comes from the swept area:
/// conservation of the vertical angular momentum makes h = x y' - y x' linear in Z, so r^2 is a
/// parabola in h.
/// @param pivot_m position of the pivot in the track's frame [m].
[[nodiscard]] std::vector<Start> top_starts(const ArcData& arc, const Eigen::Vector2d& pivot_m);

/// Places the pivot of a top may be, when nobody knows: from circles through the track.
[[nodiscard]] std::vector<Eigen::Vector2d> pivot_guesses(const ArcData& arc);

}  // namespace trochoid::fitting
