#pragma once
#include "trochoid/model/dormand_prince.hpp"
#include "trochoid/model/dual.hpp"
#include "trochoid/model/taylor.hpp"

/// The heavy symmetric top (rung M2, the thesis' "inclined disc"): equation numbers of
/// model/theory/top.md. The singularity-free form has the symmetry axis k and the angular momentum
/// over I, L = (lx, ly, lz), as state; only a = m g l / I [1/s^2] and b = Is omega_s / I [1/s]
/// enter.
namespace trochoid::model {
inline namespace TROCHOID_ISA {

/// Angles and rates of the axis; phi does not enter the dynamics.
template <class S>
struct TopAngles {
  S theta_rad, phi_rad, dtheta_rad_s, dphi_rad_s;
};

template <class S>
struct AxisAndMomentum {
  S k[3];  ///< symmetry axis
  S L[3];  ///< angular momentum about the pivot over I [1/s]
};

/// (3), (5): k and L = dtheta n + dphi sin(theta) e2 + b k.
template <class S>
[[nodiscard]] AxisAndMomentum<S> axis_and_momentum(const TopAngles<S>& start, const S& b_1_s) {
  const S s = sin(start.theta_rad), c = cos(start.theta_rad);
  const S sp = sin(start.phi_rad), cp = cos(start.phi_rad);
  const S across = start.dphi_rad_s * s;
  AxisAndMomentum<S> r;
  r.k[0] = s * sp;
  r.k[1] = -s * cp;
  r.k[2] = c;
  r.L[0] = start.dtheta_rad_s * cp - across * c * sp + b_1_s * r.k[0];
  r.L[1] = start.dtheta_rad_s * sp + across * c * cp + b_1_s * r.k[1];
  r.L[2] = across * s + b_1_s * c;
  return r;
}

/// (8): the way back; phi within (-pi, pi]. Rates come from k' = L x k, whose components stay exact
/// relative to sin(theta) near the pole; only at the pole itself phi and its rate mean nothing.
template <class S>
[[nodiscard]] TopAngles<S> angles_of(const AxisAndMomentum<S>& state) {
  const auto& k = state.k;
  const auto& L = state.L;
  const S dkx = L[1] * k[2] - L[2] * k[1], dky = L[2] * k[0] - L[0] * k[2];
  const S s2 = k[0] * k[0] + k[1] * k[1];
  const S s = sqrt(s2);
  TopAngles<S> angles;
  angles.theta_rad = atan2(s, k[2]);
  angles.phi_rad = atan2(k[0], -k[1]);
  angles.dtheta_rad_s = (L[1] * k[0] - L[0] * k[1]) / s;
  angles.dphi_rad_s = (k[0] * dky - k[1] * dkx) / s2;
  return angles;
}

/// (6): without drag L_z is constant and leaves five states.
template <class T>
struct Top {
  using Scalar = T;
  static constexpr int kStates = 5;  ///< lx, ly, kx, ky, kz
  static constexpr bool kCountsTurns = false;
  T a_1_s2, lz_1_s, b_1_s;

  void derivative(double, const State<T, 5>& y, State<T, 5>& dy) const {
    dy[0] = -a_1_s2 * y[3];
    dy[1] = a_1_s2 * y[2];
    dy[2] = y[1] * y[4] - lz_1_s * y[3];
    dy[3] = lz_1_s * y[2] - y[0] * y[4];
    dy[4] = y[0] * y[3] - y[1] * y[2];
  }
  void series(const Series<T>* y, int n, State<T, 5>& dy) const {
    dy[0] = -a_1_s2 * y[3][n];
    dy[1] = a_1_s2 * y[2][n];
    dy[2] = product(y[1], y[4], n) - lz_1_s * y[3][n];
    dy[3] = lz_1_s * y[2][n] - product(y[0], y[4], n);
    dy[4] = product(y[0], y[3], n) - product(y[1], y[2], n);
  }
  /// Coefficient n of turning().
  [[nodiscard]] T turning_series(const Series<T>* y, int n) const {
    return n == 0 ? lz_1_s - b_1_s * y[4][0] : -b_1_s * y[4][n];
  }
  [[nodiscard]] static Top at(const T& a, const T& b, const T&, const T&,
                              const AxisAndMomentum<T>& start, State<T, 5>& y) {
    y = {{start.L[0], start.L[1], start.k[0], start.k[1], start.k[2]}};
    return {a, start.L[2], b};
  }
  [[nodiscard]] AxisAndMomentum<T> unpack(const State<T, 5>& y) const {
    return {{y[2], y[3], y[4]}, {y[0], y[1], lz_1_s}};
  }
  static constexpr int kAxis = 2;  ///< index of kx
  [[nodiscard]] T spin(const State<T, 5>&) const { return b_1_s; }
  /// (lz - b kz) = dphi sin^2 theta
  [[nodiscard]] T turning(const State<T, 5>& y) const { return lz_1_s - b_1_s * y[4]; }
};

/// Coefficient n of the product of a and dy/dt, given coefficients 0..n of a and y and the rate's
/// coefficient n (the lower ones follow from y).
template <class T>
[[nodiscard]] T product_with_rate(const Series<T>& a, const Series<T>& y, const T& rate, int n) {
  T sum = a[0] * rate;
  for (int j = 1; j <= n; ++j) multiply_add(sum, a[j] * (n - j + 1.0), y[n - j + 1]);
  return sum;
}

/// (7): with drag couples -c1 (w - w3 k) across and -(t0 sgn(w3) + c3 w3 + q3 w3|w3|) k along the
/// axis, which turn up as gamma1 = c1/I, gamma3 = c3/Is, dry = t0/I [1/s^2] and quadratic =
/// q3 I/Is^2 [1]. The state holds the part of L across the axis, so that the spin b obeys an
/// equation of its own, the only one its drag enters; terms that are not wanted are not in it.
template <class T, bool Dry = false, bool Quadratic = false>
struct TopWithDrag {
  using Scalar = T;
  static constexpr int kStates = 7;  ///< L - b k (x, y, z), kx, ky, kz, b
  static constexpr bool kDry = Dry, kQuadratic = Quadratic;
  static constexpr bool kCountsTurns = Dry || Quadratic;  ///< else their number has a closed form
  T a_1_s2, gamma1_1_s, gamma3_1_s;
  T dry_1_s2{0.0}, quadratic{0.0};
  double sense = 1.0;  ///< sign of b; 0 once dry friction has stopped the spin

  void derivative(double, const State<T, 7>& y, State<T, 7>& dy) const {
    dy[3] = y[1] * y[5] - y[2] * y[4];
    dy[4] = y[2] * y[3] - y[0] * y[5];
    dy[5] = y[0] * y[4] - y[1] * y[3];
    dy[0] = -a_1_s2 * y[4] - gamma1_1_s * y[0] - y[6] * dy[3];
    dy[1] = a_1_s2 * y[3] - gamma1_1_s * y[1] - y[6] * dy[4];
    dy[2] = -gamma1_1_s * y[2] - y[6] * dy[5];
    dy[6] = -gamma3_1_s * y[6];
    if constexpr (Dry) dy[6] -= dry_1_s2 * sense;
    if constexpr (Quadratic) dy[6] -= quadratic * y[6] * y[6] * sense;
  }
  void series(const Series<T>* y, int n, State<T, 7>& dy) const {
    dy[3] = product(y[1], y[5], n) - product(y[2], y[4], n);
    dy[4] = product(y[2], y[3], n) - product(y[0], y[5], n);
    dy[5] = product(y[0], y[4], n) - product(y[1], y[3], n);
    for (int i = 0; i < 3; ++i)
      dy[i] = -gamma1_1_s * y[i][n] - product_with_rate(y[6], y[3 + i], dy[3 + i], n);
    dy[0] -= a_1_s2 * y[4][n];
    dy[1] += a_1_s2 * y[3][n];
    dy[6] = -gamma3_1_s * y[6][n];
    if constexpr (Dry) {
      if (n == 0) dy[6] -= dry_1_s2 * sense;
    }
    if constexpr (Quadratic) dy[6] -= quadratic * product(y[6], y[6], n) * sense;
  }
  [[nodiscard]] T turning_series(const Series<T>* y, int n) const { return y[2][n]; }
  [[nodiscard]] static TopWithDrag at(const T& a, const T& b, const T& gamma1, const T& gamma3,
                                      const AxisAndMomentum<T>& start, State<T, 7>& y) {
    for (int i = 0; i < 3; ++i) {
      y[i] = start.L[i] - b * start.k[i];
      y[3 + i] = start.k[i];
    }
    y[6] = b;
    return {a, gamma1, gamma3};
  }
  [[nodiscard]] AxisAndMomentum<T> unpack(const State<T, 7>& y) const {
    return {{y[3], y[4], y[5]}, {y[0] + y[6] * y[3], y[1] + y[6] * y[4], y[2] + y[6] * y[5]}};
  }
  static constexpr int kAxis = 3;
  static constexpr int kSpin = 6;
  [[nodiscard]] T spin(const State<T, 7>& y) const { return y[kSpin]; }
  [[nodiscard]] T turning(const State<T, 7>& y) const { return y[2]; }
};

/// (9): one more state for the spin angle, without omega_s: with side = +1 d(phi + psi)/dt -
/// omega_s = turning/(1 + kz), regular but for theta = pi; with side = -1 d(phi - psi)/dt + omega_s
/// = turning/(1 - kz), regular but for theta = 0. What omega_s adds is closed form, or follows from
/// a last state, the integral of b.
template <class Base>
struct WithSpinAngle : Base {
  using Base_ = Base;
  using T = typename Base::Scalar;
  static constexpr int kAngle = Base::kStates, kTurns = kAngle + 1;  ///< indices of these states
  static constexpr int kStates = Base::kStates + (Base::kCountsTurns ? 2 : 1);
  double side = 1.0;

  void derivative(double t_s, const State<T, kStates>& y, State<T, kStates>& dy) const {
    const State<T, Base::kStates> y_base = base(y);
    State<T, Base::kStates> dy_base;
    Base::derivative(t_s, y_base, dy_base);
    for (int i = 0; i < Base::kStates; ++i) dy[i] = dy_base[i];
    dy[kAngle] = Base::turning(y_base) / (1.0 + side * y_base[Base::kAxis + 2]);
    if constexpr (Base::kCountsTurns) dy[kTurns] = Base::spin(y_base);
  }
  /// The quotient q of (9) obeys (1 + side kz) q = turning; its coefficients are those of the
  /// angle, q_j = (j + 1) angle_(j+1).
  void series(const Series<T>* y, int n, State<T, kStates>& dy) const {
    State<T, Base::kStates> dy_base;
    Base::series(y, n, dy_base);
    for (int i = 0; i < Base::kStates; ++i) dy[i] = dy_base[i];
    T rest = Base::turning_series(y, n);
    for (int j = 0; j < n; ++j) {
      rest -= y[Base::kAxis + 2][n - j] * y[kAngle][j + 1] * (side * (j + 1));
    }
    dy[kAngle] = rest / (1.0 + side * y[Base::kAxis + 2][0]);
    if constexpr (Base::kCountsTurns) dy[kTurns] = y[Base::kSpin][n];
  }
  [[nodiscard]] static State<T, Base::kStates> base(const State<T, kStates>& y) {
    State<T, Base::kStates> y_base;
    for (int i = 0; i < Base::kStates; ++i) y_base[i] = y[i];
    return y_base;
  }
};

/// The thesis' own equations (2.24), (2.25) in Euler angles, state phi, theta, dphi, dtheta, psi
/// without its omega_s part: singular at theta = 0 and pi, kept to compare with. The thesis plots
/// (X, Y) = (-y, x) of our axes.
template <class T>
struct TopEuler {
  using Scalar = T;
  static constexpr int kStates = 5;
  T a_1_s2, b_1_s;

  void derivative(double, const State<T, 5>& y, State<T, 5>& dy) const {
    const T s = sin(y[1]), c = cos(y[1]);
    dy[0] = y[2];
    dy[1] = y[3];
    dy[2] = (b_1_s - 2.0 * y[2] * c) * y[3] / s;
    dy[3] = s * (a_1_s2 + y[2] * y[2] * c - b_1_s * y[2]);
    dy[4] = -y[2] * c;
  }
};

}  // namespace TROCHOID_ISA
}  // namespace trochoid::model
