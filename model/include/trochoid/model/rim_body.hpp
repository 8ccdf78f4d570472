#pragma once
#include "trochoid/model/dormand_prince.hpp"

/// A disc or ring with the lowest point of its rim on the floor: geometry shared by the rolling,
/// sliding and smooth models. Equation numbers of model/theory/rolling.md.
///
///   theta      angle between symmetry axis k and the vertical Z [rad]; pi/2 stands on edge
///   phi, psi   precession and spin [rad]
///   n e2 k     node frame: n horizontal, e2 up along the steepest line of the disc, k the axis
///   mh         horizontal, across the node line: mh = cos(theta) e2 - sin(theta) k
///   w1 w2 w3   angular velocity along n, e2, k [rad/s]
///   m A C      mass [kg], central moments across and along k [kg m^2]
///   R h        rim radius and half thickness [m]
namespace trochoid::model {
inline namespace TROCHOID_ISA {

/// Order of the state of every model with rim contact. Rolling bodies have the first eight. Sliding
/// ones add the velocity of the contact point along n and mh instead of that of the centre: near
/// sticking it is small, and a step must resolve it by its own size.
struct Rim {
  enum Component : int { phi, theta, psi, w1, w2, w3, x, y, un, ut };
};

/// Tilt at which a face is taken to touch the floor [rad]: the far edge of a disc of 3 cm radius is
/// then 0.6 mm above it.
inline constexpr double kFlat_rad = 0.01;

struct RimBody {
  double m = 1.0, A = 0.0, C = 0.0;
  double R = 0.0, h = 0.0;
  double g = 9.81;
  /// +1: the rim below k's far face touches (theta < pi/2); -1: the other rim. h enters as side *
  /// h.
  double side = 1.0;

  [[nodiscard]] double signed_h() const { return side * h; }
};

/// @returns the `side` of the rim that touches: by the tilt, and exactly on edge by the sense of
/// falling.
[[nodiscard]] inline double touching_side(double theta_rad, double w1_rad_s) {
  constexpr double kOnEdge = 1e-15;  // the cosine of the double next to pi/2 is 6e-17
  const double c = cos(theta_rad);
  return __builtin_fabs(c) < kOnEdge ? (w1_rad_s > 0.0 ? -1.0 : 1.0) : (c < 0.0 ? -1.0 : 1.0);
}

/// sin and cos of the tilt, height z(theta) of the centre of mass and its slope dz/dtheta;
/// d2z/dtheta2 = -z.                                                                          (2)
template <class S>
struct Tilt {
  S s, c, z, slope;
};
template <class S>
[[nodiscard]] TROCHOID_INLINE Tilt<S> tilt(const RimBody& body, const S& theta) {
  const S s = sin(theta), c = cos(theta);
  const double h = body.signed_h();
  return {s, c, body.R * s + h * c, body.R * c - h * s};
}

/// Angular velocity and velocity of the centre of mass in the node frame, with what they hang on.
template <class S>
struct NodeMotion {
  Tilt<S> at;
  S w1, w2, w3;
  S precession_k;  ///< dphi cos(theta) = w2 cot(theta): the node frame's own rate about k
  S v1, v2, v3;
  S phi;  ///< for what has a direction in the world
};

/// Couple about the centre of mass, and body force at it, in node components [N m], [N].
template <class S>
struct Load {
  S t1{0.0}, t2{0.0}, t3{0.0};
  S d1{0.0}, d2{0.0}, d3{0.0};
};

/// Contact couple per unit normal force, node components [m].
template <class S>
struct ContactCouple {
  S k1{0.0}, k2{0.0}, k3{0.0};
};

/// Force of the floor on the body: normal N along Z, and tangential along n and mh [N].
template <class S>
struct ContactForce {
  S normal, along_n, along_mh;
};

/// Kinetic and potential energy above the floor [J], (9).
template <class S>
[[nodiscard]] S energy_J(const RimBody& body, const NodeMotion<S>& q) {
  return 0.5 * body.m * (q.v1 * q.v1 + q.v2 * q.v2 + q.v3 * q.v3) +
         0.5 * body.A * (q.w1 * q.w1 + q.w2 * q.w2) + 0.5 * body.C * q.w3 * q.w3 +
         body.m * body.g * q.at.z;
}

/// A horizontal vector: components along n and mh.
template <class S>
struct Horizontal {
  S along_n, along_mh;
};
/// ... and in the world's axes.
template <class S>
struct World {
  S x, y;
};
template <class S>
[[nodiscard]] TROCHOID_INLINE World<S> world_from_node(const Horizontal<S>& a, const S& phi) {
  const S c = cos(phi), s = sin(phi);
  return {a.along_n * c - a.along_mh * s, a.along_n * s + a.along_mh * c};
}
template <class S>
[[nodiscard]] TROCHOID_INLINE Horizontal<S> node_from_world(const World<S>& a, const S& phi) {
  const S c = cos(phi), s = sin(phi);
  return {a.x * c + a.y * s, a.y * c - a.x * s};
}
/// Horizontal velocity of the centre of mass.
template <class S>
[[nodiscard]] TROCHOID_INLINE Horizontal<S> horizontal_velocity(const NodeMotion<S>& q) {
  return {q.v1, q.v2 * q.at.c - q.v3 * q.at.s};
}

}  // namespace TROCHOID_ISA
}  // namespace trochoid::model
