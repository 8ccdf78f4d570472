#pragma once
#include "trochoid/model/rim_body.hpp"

/// Loss mechanisms and the floor's slope, one named struct each, and Losses<...>, the list of those
/// a scene has. A list is fixed at compile time: what is not in it costs nothing. Equation numbers
/// of model/theory/air.md ("A"), model/theory/sliding.md ("S") and model/theory/rolling.md.
///
/// A term has kLoad (adds a couple or force), kContact (adds a couple per unit normal force) and
/// the function that goes with it.
namespace trochoid::model {
inline namespace TROCHOID_ISA {

/// Couple -c_i w_i along each principal node axis (A1); c_i in N m s, c1 = c2 for a free body.
template <class S>
struct LinearAir {
  static constexpr bool kLoad = true, kContact = false;
  S c1{0.0}, c2{0.0}, c3{0.0};
  [[nodiscard]] LinearAir<double> values() const {
    return {value_of(c1), value_of(c2), value_of(c3)};
  }
  TROCHOID_INLINE void add(const RimBody&, const NodeMotion<S>& q, Load<S>& load) const {
    load.t1 -= c1 * q.w1;
    load.t2 -= c2 * q.w2;
    load.t3 -= c3 * q.w3;
  }
};

/// Couple -q_i |w| w_i (A2); q_i in N m s^2.
template <class S>
struct QuadraticAir {
  static constexpr bool kLoad = true, kContact = false;
  S q1{0.0}, q2{0.0}, q3{0.0};
  [[nodiscard]] QuadraticAir<double> values() const {
    return {value_of(q1), value_of(q2), value_of(q3)};
  }
  TROCHOID_INLINE void add(const RimBody&, const NodeMotion<S>& q, Load<S>& load) const {
    // The offset keeps the square root differentiable at rest; it changes |w| by < 1e-15 rad/s.
    const S speed = sqrt(q.w1 * q.w1 + q.w2 * q.w2 + q.w3 * q.w3 + 1e-30);
    load.t1 -= q1 * speed * q.w1;
    load.t2 -= q2 * speed * q.w2;
    load.t3 -= q3 * speed * q.w3;
  }
};

/// Force -c_v v at the centre of mass (A3); c_v in N s/m.
template <class S>
struct AirForce {
  static constexpr bool kLoad = true, kContact = false;
  S c_v{0.0};
  [[nodiscard]] AirForce<double> values() const { return {value_of(c_v)}; }
  TROCHOID_INLINE void add(const RimBody&, const NodeMotion<S>& q, Load<S>& load) const {
    load.d1 -= c_v * q.v1;
    load.d2 -= c_v * q.v2;
    load.d3 -= c_v * q.v3;
  }
};

/// Viscous shear in the wedge of air below a nearly flat disc, as an equivalent couple on phi
/// [Moffatt2000] (A4); eta in Pa s (air 1.8e-5).
template <class S>
struct GapLayer {
  static constexpr bool kLoad = true, kContact = false;
  S eta{0.0};
  [[nodiscard]] GapLayer<double> values() const { return {value_of(eta)}; }
  TROCHOID_INLINE void add(const RimBody& body, const NodeMotion<S>& q, Load<S>& load) const {
    constexpr double kQuarterPi = 0.78539816339744830962;
    const double scale = kQuarterPi * body.R * body.R * body.R;
    load.t2 -= scale * eta * q.w2 / (q.at.s * q.at.s * q.at.s);
  }
};

/// A floor that rises by (x, y) per length: the weight's part along it, a uniform field at the
/// centre of mass, (13) of rolling.md.
template <class S>
struct FloorSlope {
  static constexpr bool kLoad = true, kContact = false;
  World<S> rise{S(0.0), S(0.0)};
  [[nodiscard]] FloorSlope<double> values() const { return {{value_of(rise.x), value_of(rise.y)}}; }
  TROCHOID_INLINE void add(const RimBody& body, const NodeMotion<S>& q, Load<S>& load) const {
    const double weight = body.m * body.g;
    const Horizontal<S> uphill = node_from_world(rise, q.phi);
    load.d1 -= weight * uphill.along_n;
    load.d2 -= weight * uphill.along_mh * q.at.c;
    load.d3 += weight * uphill.along_mh * q.at.s;
  }
  /// Of a centre of mass at (x, y), beside what its height above the floor has.
  [[nodiscard]] S energy_J(const RimBody& body, const S& x, const S& y) const {
    return body.m * body.g * (rise.x * x + rise.y * y);
  }
};

/// Rolling friction: a horizontal couple mu_r N against the horizontal angular velocity (S11).
template <class S>
struct RollingFriction {
  static constexpr bool kLoad = false, kContact = true;
  S mu_r{0.0};          ///< [m]
  double eps_w = 0.01;  ///< regularisation [rad/s]
  [[nodiscard]] RollingFriction<double> values() const { return {value_of(mu_r), eps_w}; }
  TROCHOID_INLINE void add(const NodeMotion<S>& q, ContactCouple<S>& couple) const {
    const S wt = q.w2 * q.at.c - q.w3 * q.at.s;
    const S scale = mu_r / sqrt(q.w1 * q.w1 + wt * wt + eps_w * eps_w);
    couple.k1 -= scale * q.w1;
    couple.k2 -= scale * wt * q.at.c;
    couple.k3 += scale * wt * q.at.s;
  }
};

/// Pivoting (drilling) friction: a vertical couple mu_p N against the vertical spin (S12).
template <class S>
struct PivotingFriction {
  static constexpr bool kLoad = false, kContact = true;
  S mu_p{0.0};          ///< [m]
  double eps_w = 0.01;  ///< [rad/s]
  [[nodiscard]] PivotingFriction<double> values() const { return {value_of(mu_p), eps_w}; }
  TROCHOID_INLINE void add(const NodeMotion<S>& q, ContactCouple<S>& couple) const {
    const S wz = q.w2 * q.at.s + q.w3 * q.at.c;
    const S scale = mu_p * wz / sqrt(wz * wz + eps_w * eps_w);
    couple.k2 -= scale * q.at.s;
    couple.k3 -= scale * q.at.c;
  }
};

/// Contour friction: resists the wandering of the contact along the rim, so it acts on psi only
/// (S13).
template <class S>
struct ContourFriction {
  static constexpr bool kLoad = false, kContact = true;
  S mu_c{0.0};          ///< [m]
  double eps_w = 0.01;  ///< [rad/s]
  [[nodiscard]] ContourFriction<double> values() const { return {value_of(mu_c), eps_w}; }
  TROCHOID_INLINE void add(const NodeMotion<S>& q, ContactCouple<S>& couple) const {
    const S spin = q.w3 - q.precession_k;
    const S scale = mu_c * spin / sqrt(spin * spin + eps_w * eps_w);
    couple.k2 += scale * q.at.c / q.at.s;
    couple.k3 -= scale;
  }
};

/// The terms a model is compiled with.
template <class S, template <class> class... Terms>
struct Losses : Terms<S>... {
  static constexpr bool kLoad = (false || ... || Terms<S>::kLoad);
  static constexpr bool kContact = (false || ... || Terms<S>::kContact);

  /// Calls visit(term) for every term of the list.
  template <class Visit>
  void each(Visit&& visit) {
    (visit(static_cast<Terms<S>&>(*this)), ...);
  }
  /// The same without derivatives.
  [[nodiscard]] Losses<double, Terms...> values() const {
    return {static_cast<const Terms<S>&>(*this).values()...};
  }
  [[nodiscard]] TROCHOID_INLINE Load<S> load(const RimBody& body, const NodeMotion<S>& q) const {
    Load<S> sum;
    (add_load<Terms<S>>(body, q, sum), ...);
    return sum;
  }
  [[nodiscard]] TROCHOID_INLINE ContactCouple<S> contact_couple(const NodeMotion<S>& q) const {
    ContactCouple<S> sum;
    (add_contact<Terms<S>>(q, sum), ...);
    return sum;
  }

 private:
  template <class Term>
  TROCHOID_INLINE void add_load(const RimBody& body, const NodeMotion<S>& q, Load<S>& sum) const {
    if constexpr (Term::kLoad) static_cast<const Term&>(*this).add(body, q, sum);
  }
  template <class Term>
  TROCHOID_INLINE void add_contact(const NodeMotion<S>& q, ContactCouple<S>& sum) const {
    if constexpr (Term::kContact) static_cast<const Term&>(*this).add(q, sum);
  }
};

}  // namespace TROCHOID_ISA
}  // namespace trochoid::model
