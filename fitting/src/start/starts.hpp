#pragma once
#include <map>
#include <string>
#include <vector>

#include "observe/observations.hpp"
#include "trochoid/model/rim_body.hpp"

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

/// Starts for a fast top, whose nutation is a small, fast tremble on slow precession: precession
/// from a smooth path about the pivot, b from the strongest line in what is left, a = W (b - W cos
/// theta). None where no line stands out of the noise.
[[nodiscard]] std::vector<Start> fast_top_starts(const ArcData& arc,
                                                 const Eigen::Vector2d& pivot_m);

/// Places the pivot of a top may be, when nobody knows, best first: where a top about them leaves
/// least of the path, of all places within the path's extent about its mean.
[[nodiscard]] std::vector<Eigen::Vector2d> pivot_guesses(const ArcData& arc);

/// Starts for a body that rolls (or slides) on its rim, state at the window's first sample.
/// With tilt and precession in the track: w1 = dtheta, w2 = dphi sin(theta); no slip, v_n = h w2 -
/// R w3, gives the spin, and so does steady rolling where a turn has few readings. From positions
/// alone: a grid over the tilt, the direction of motion against the node line and the precession
/// rate (the path's turning rate, and the two roots of steady rolling). A body that slides may also
/// slip at its start, against its acceleration: a grid over the slip's speed, and the spin at which
/// the couples balance, from the angles or from how fast the acceleration veers.
/// @param body    of unit mass: moments are per mass [m^2].
/// @param slides  friction is a parameter.
[[nodiscard]] std::vector<Start> rim_starts(const ArcData& window, const model::RimBody& body,
                                            bool slides);

/// States of a rim whose centre goes nearly the same way as that of a known one, but which leans
/// the other way: the axis half a turn round, the same velocity of the centre and precession rate,
/// and a tilt at which it rolls steadily so; there may be none or several.
/// @param known  state of a rim; what else it has is kept. None where its tilt is not below pi/2.
[[nodiscard]] std::vector<Start> leaning_otherwise(const model::RimBody& body, const Start& known);

/// Starts for a flat puck: position and velocity from the window, friction from the deceleration.
[[nodiscard]] std::vector<Start> puck_starts(const ArcData& window, double gravity_m_s2);

/// Starts for a disc spinning down on a pivot, from its angle and the double integrals of
/// dw/dt = -(t0 sgn w + t1 w + t2 w|w|) - Gs sin psi - Gc cos psi along it, by least squares with
/// the losses not negative. Unbalanced: with the last two terms.
[[nodiscard]] std::vector<Start> pivot_starts(const ArcData& window, bool unbalanced);

}  // namespace trochoid::fitting
