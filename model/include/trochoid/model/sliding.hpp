#pragma once
#include "trochoid/model/rolling.hpp"

/// Disc or ring whose rim point slides on the floor: smooth floor (M3) and Coulomb friction (M5).
/// Equation numbers of model/theory/sliding.md; symbols in rim_body.hpp.
namespace trochoid::model {
inline namespace TROCHOID_ISA {

/// Smooth floor.
template <class S>
struct NoFriction {
  static constexpr bool kActive = false;
  [[nodiscard]] NoFriction<double> values() const { return {}; }
};

/// Sliding friction mu N against the slip, (S2). With eps_v > 0 the regularised law (S3):
/// mu N u / sqrt(u^2 + eps_v^2), part of the model and not a numerical device.
template <class S>
struct Coulomb {
  static constexpr bool kActive = true;
  S mu{0.0};
  S eps_v{0.0};  ///< [m/s]
  [[nodiscard]] Coulomb<double> values() const { return {value_of(mu), value_of(eps_v)}; }
  /// Friction per unit normal force along n and mh.
  [[nodiscard]] TROCHOID_INLINE Horizontal<S> per_normal(const Horizontal<S>& u) const {
    const S scale = mu / sqrt(u.along_n * u.along_n + u.along_mh * u.along_mh + eps_v * eps_v);
    return {-scale * u.along_n, -scale * u.along_mh};
  }
};

template <class S, template <class> class Friction, template <class> class... Terms>
struct Sliding {
  using Scalar = S;
  using LossList = Losses<S, Terms...>;
  static constexpr int kStates = 10;
  static constexpr int kEvents = 5;
  enum Event : int { flat, rim, lift_off, inconsistent, stick };

  RimBody body;
  LossList losses;
  Friction<S> friction;
  double stick_speed_m_s = 0.0;  ///< slip below which the exact law may stick; 0: never asks

  [[nodiscard]] Sliding<double, Friction, Terms...> values() const {
    return {body, losses.values(), friction.values(), stick_speed_m_s};
  }

  [[nodiscard]] TROCHOID_INLINE NodeMotion<S> motion(const State<S, kStates>& y) const {
    NodeMotion<S> q;
    q.phi = y[Rim::phi];
    q.at = tilt(body, y[Rim::theta]);
    q.w1 = y[Rim::w1];
    q.w2 = y[Rim::w2];
    q.w3 = y[Rim::w3];
    q.precession_k = q.w2 * q.at.c / q.at.s;
    const S vt = y[Rim::ut] - q.at.z * q.w1;  // (S1)
    const S vz = q.at.slope * q.w1;
    q.v1 = y[Rim::un] - body.R * q.w3 + body.signed_h() * q.w2;
    q.v2 = vt * q.at.c + vz * q.at.s;
    q.v3 = vz * q.at.c - vt * q.at.s;
    return q;
  }

  /// Of the contact point, as the state has it: reckoned from the other velocities it would be
  /// known to their rounding only, and a body that sticks creeps slower than that.
  [[nodiscard]] static TROCHOID_INLINE Horizontal<S> slip(const State<S, kStates>& y) {
    return {y[Rim::un], y[Rim::ut]};
  }

  struct Contact {
    RimAcceleration<S> a;
    ContactForce<S> force;
    S consistency;      ///< 1 - m (dz/dtheta) G1 / A; the contact has a solution only while > 0
    S drag_n, drag_mh;  ///< horizontal air force [N]
  };

  [[nodiscard]] TROCHOID_INLINE Contact contact(const NodeMotion<S>& q,
                                                const Horizontal<S>& slip) const {
    const double m = body.m, A = body.A, h = body.signed_h();
    S g0 = (A * q.precession_k - body.C * q.w3) * q.w2;  // couples on w1 without and per N  (S4)
    S g1 = -q.at.slope;
    S b2 = (body.C * q.w3 - A * q.precession_k) * q.w1;
    S b3(0.0);
    S weight = m * (body.g - q.at.z * q.w1 * q.w1);
    Contact r;
    r.drag_n = r.drag_mh = S(0.0);
    if constexpr (LossList::kLoad) {
      const Load<S> load = losses.load(body, q);
      g0 += load.t1;
      b2 += load.t2;
      b3 += load.t3;
      weight -= q.at.s * load.d2 + q.at.c * load.d3;
      r.drag_n = load.d1;
      r.drag_mh = q.at.c * load.d2 - q.at.s * load.d3;
    }
    Horizontal<S> f{S(0.0), S(0.0)};
    if constexpr (Friction<S>::kActive) {
      f = friction.per_normal(slip);
      g1 += q.at.z * f.along_mh;
    }
    ContactCouple<S> couple;
    if constexpr (LossList::kContact) {
      couple = losses.contact_couple(q);
      g1 += couple.k1;
    }
    const S lever = (m / A) * q.at.slope;
    r.consistency = 1.0 - lever * g1;
    const S n = (weight + lever * g0) / r.consistency;  // (S5)
    r.force = {n, n * f.along_n, n * f.along_mh};
    r.a.normal = n;
    r.a.w1 = (g0 + n * g1) * (1.0 / A);                                         // (S6)
    r.a.w2 = (b2 - h * r.force.along_n + n * couple.k2) * (1.0 / A);            // (S7)
    r.a.w3 = (b3 + body.R * r.force.along_n + n * couple.k3) * (1.0 / body.C);  // (S8)
    return r;
  }

  void derivative(double, const State<S, kStates>& y, State<S, kStates>& dy) const {
    widely<S>([&]() TROCHOID_LAMBDA_INLINE { rates(y, dy); });
  }

  TROCHOID_INLINE void rates(const State<S, kStates>& y, State<S, kStates>& dy) const {
    const NodeMotion<S> q = motion(y);
    const Contact r = contact(q, slip(y));
    dy[Rim::phi] = q.w2 / q.at.s;
    dy[Rim::theta] = q.w1;
    dy[Rim::psi] = q.w3 - q.precession_k;
    dy[Rim::w1] = r.a.w1;
    dy[Rim::w2] = r.a.w2;
    dy[Rim::w3] = r.a.w3;
    const Horizontal<S> v = horizontal_velocity(q);
    const World<S> v_world = world_from_node(v, y[Rim::phi]);
    dy[Rim::x] = v_world.x;
    dy[Rim::y] = v_world.y;
    // Acceleration of the centre in the turning node frame (S9), then of the contact point (S10).
    S an = dy[Rim::phi] * v.along_mh, at = -dy[Rim::phi] * v.along_n;
    if constexpr (Friction<S>::kActive || LossList::kLoad) {
      an += (r.force.along_n + r.drag_n) * (1.0 / body.m);
      at += (r.force.along_mh + r.drag_mh) * (1.0 / body.m);
    }
    dy[Rim::un] = an + body.R * r.a.w3 - body.signed_h() * r.a.w2;
    dy[Rim::ut] = at + q.at.slope * q.w1 * q.w1 + q.at.z * r.a.w1;
  }

  /// Face contact, the other rim's touch, lift-off, no admissible force, end of slip.
  void events(double, const State<S, kStates>& y, State<S, kEvents>& g) const {
    const NodeMotion<S> q = motion(y);
    const Horizontal<S> u = slip(y);
    const Contact r = contact(q, u);
    g[flat] = q.at.s - kFlat_rad;
    g[rim] = body.h > 0.0 ? body.side * q.at.c : S(1.0);
    // N changes sign through infinity where the contact becomes inconsistent: look at N times that.
    g[lift_off] = r.a.normal * r.consistency * (1.0 / (body.m * body.g));
    g[inconsistent] = r.consistency;
    g[stick] = S(1.0);
    if (stick_speed_m_s > 0.0)
      g[stick] =
          sqrt(u.along_n * u.along_n + u.along_mh * u.along_mh + 1e-300) * (1.0 / stick_speed_m_s) -
          1.0;
  }
};

}  // namespace TROCHOID_ISA
}  // namespace trochoid::model
