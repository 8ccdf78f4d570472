#pragma once
#include "trochoid/model/dormand_prince.hpp"

/// A disc or ring lying on its face, sliding and spinning (M7). Coulomb's law integrated over the
/// face couples both motions [Farkas2003]. Equation numbers of model/theory/puck.md.
namespace trochoid::model {
inline namespace TROCHOID_ISA {

/// Complete elliptic integrals B = (E - (1-k^2) K)/k^2, D = (K - E)/k^2, C = (D - B)/k^2 and
/// K = B + D by the arithmetic-geometric mean, without cancellation for k -> 0; 0 <= k <= 1. At k =
/// 1 K and D are infinite: they come out as for 1 - k^2 = 1e-30, and only ever enter times 1 - k^2.
struct EllipticIntegrals {
  double K, B, D, C;
};
[[nodiscard]] inline EllipticIntegrals elliptic_integrals(double k) {
  const double k2 = k * k, complement2 = 1.0 - k2 > 1e-30 ? 1.0 - k2 : 1e-30;
  double a = 1.0, b = __builtin_sqrt(complement2);
  double d = 0.5 / (1.0 + b);  // c_n / k^2 of the arithmetic-geometric mean
  double sum = 0.0, weight = 1.0;
  for (int n = 0; n < 12 && (n < 2 || __builtin_fabs(a - b) > 1e-15 * a); ++n) {
    sum += weight * d * d;
    const double mean = 0.5 * (a + b);
    b = __builtin_sqrt(a * b);
    a = mean;
    weight *= 2.0;
    d = k2 * d * d / (2.0 * (a + b));
  }
  constexpr double kHalfPi = 1.57079632679489661923;
  EllipticIntegrals r;
  r.K = kHalfPi / (0.5 * (a + b));
  r.D = r.K * (0.5 + sum * k2);
  r.B = r.K - r.D;
  r.C = 2.0 * r.K * sum;
  return r;
}

/// Friction of a face of radius r at slip velocity v and rim speed q = r |w|, as fractions of mu N:
/// the force is -force * v / max(v, q), the couple -r * couple * q / max(v, q); with derivatives by
/// k = min/max of v and q.                                                              (3), (4)
struct FaceFriction {
  double force, force_slope, couple, couple_slope;
};
[[nodiscard]] inline FaceFriction face_friction(double k, bool spin_dominates) {
  constexpr double kForce = 0.42441318157838756205;   // 4/(3 pi)
  constexpr double kCouple = 0.14147106052612918735;  // 4/(9 pi)
  const EllipticIntegrals e = elliptic_integrals(k);
  const double rest = 1.0 - k * k, E = e.B + rest * e.D;
  FaceFriction f;
  if (spin_dominates) {  // k = v/q = e <= 1
    f.force = kForce * (E + e.B);
    f.force_slope = kForce * k * (e.C - e.D);
    f.couple = kCouple * ((4.0 - 2.0 * k * k) * E - rest * e.K);
    f.couple_slope = -kCouple * k * (3.0 * e.B + 6.0 * rest * e.D);
  } else {  // k = q/v = 1/e < 1
    f.force = kForce * (E + e.B);
    f.force_slope = kForce * k * (e.C - e.D);
    f.couple = kCouple * (e.C - e.D + 3.0 * e.B);
    // Below 1e-3 the difference cancels; the series is k/24 + O(k^3).
    f.couple_slope = k < 1e-3 ? k / 24.0 : kCouple * ((e.B - 4.0 * e.C) / k + 4.0 * k * e.C);
  }
  return f;
}

/// Friction of one full face: force components and couple (times 1/r) per mu N.
template <class S>
struct FaceForce {
  S x, y, couple;
};
/// @param vx, vy  velocity of the centre, q = r w rim speed from the spin [m/s], not all zero.
template <class S>
[[nodiscard]] FaceForce<S> face_force(const S& vx, const S& vy, const S& q) {
  // The offset only keeps the square root differentiable at v = 0.
  const S v = sqrt(vx * vx + vy * vy + 1e-300), w = abs(q);
  const bool spin_dominates = value_of(v) <= value_of(w);
  const S k = spin_dominates ? v / w : w / v;
  const double at = value_of(k) < 1.0 ? value_of(k) : 1.0;
  const FaceFriction f = face_friction(at, spin_dominates);
  const S change = k - value_of(k);  // value 0: carries the derivatives
  const S scale = 1.0 / (spin_dominates ? w : v);
  const S force = (f.force + f.force_slope * change) * scale;
  const S couple = (f.couple + f.couple_slope * change) * scale;
  return {force * vx, force * vy, couple * q};
}

/// The motion in the stretched time tau, dt = rho/(mu g) dtau with rho^2 = v^2 + (R w)^2: in tau
/// both velocities die off exponentially, and the instant at which they vanish together, a
/// singularity in t, lies at infinity. (5)
template <class S>
struct Puck {
  using Scalar = S;
  static constexpr int kStates = 7;
  enum Component : int { vx, vy, q, x, y, psi, t };  ///< q = R w

  S friction{0.1};
  S drag_1_s{0.0};             ///< air force over mass
  S rise_x{0.0}, rise_y{0.0};  ///< of the floor per length
  double gravity = 9.81;       ///< [m/s^2]
  S radius{0.0};      ///< R [m] of the face in contact; less than the body's if it is crowned
  double bore = 0.0;  ///< inner radius of the face over R, 0 <= bore < 1
  S gyration{0.5};    ///< C/(m R^2)

  /// dv/dt and R dw/dt [m/s^2] while moving, (1), (2).
  [[nodiscard]] FaceForce<S> acceleration(const State<S, kStates>& s) const {
    FaceForce<S> f = face_force<S>(s[vx], s[vy], s[q]);
    if (bore > 0.0) {  // a ring is a disc less its bore: N is spread over the remaining area
      const FaceForce<S> inner = face_force<S>(s[vx], s[vy], s[q] * bore);
      const double b2 = bore * bore, area = 1.0 / (1.0 - b2);
      f.x = (f.x - b2 * inner.x) * area;
      f.y = (f.y - b2 * inner.y) * area;
      f.couple = (f.couple - b2 * bore * inner.couple) * area;
    }
    const S scale = friction * -gravity;
    return {scale * f.x - drag_1_s * s[vx] - gravity * rise_x,
            scale * f.y - drag_1_s * s[vy] - gravity * rise_y, scale * f.couple * (1.0 / gyration)};
  }
  /// dt/dtau [s].
  [[nodiscard]] S stretch(const State<S, kStates>& s) const {
    return sqrt(s[vx] * s[vx] + s[vy] * s[vy] + s[q] * s[q]) / (friction * gravity);
  }
  void derivative(double, const State<S, kStates>& s, State<S, kStates>& ds) const {
    const S pace = stretch(s);
    const FaceForce<S> a = acceleration(s);
    ds[vx] = a.x * pace;
    ds[vy] = a.y * pace;
    ds[q] = a.couple * pace;
    ds[x] = s[vx] * pace;
    ds[y] = s[vy] * pace;
    ds[psi] = s[q] * (1.0 / radius) * pace;
    ds[t] = pace;
  }
};

}  // namespace TROCHOID_ISA
}  // namespace trochoid::model
