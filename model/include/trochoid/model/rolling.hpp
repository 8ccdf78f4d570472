#pragma once
#include "trochoid/model/dissipation.hpp"
#include "trochoid/model/widely.hpp"

/// Disc or ring of finite thickness rolling without slip (M4). Equation numbers of
/// model/theory/rolling.md; symbols in rim_body.hpp.
namespace trochoid::model {
inline namespace TROCHOID_ISA {

/// Angular accelerations of the node components [rad/s^2] and the normal force [N].
template <class S>
struct RimAcceleration {
  S w1, w2, w3, normal;
};

template <class S, template <class> class... Terms>
struct Rolling {
  using LossList = Losses<S, Terms...>;
  using Scalar = S;
  static constexpr int kStates = 8;
  static constexpr int kEvents = 4;
  enum Event : int { flat, rim, lift_off, slip };

  RimBody body;
  LossList losses;
  S friction{0.0};  ///< Coulomb coefficient that ends rolling, 0: any force is borne

  [[nodiscard]] Rolling<double, Terms...> values() const {
    return {body, losses.values(), value_of(friction)};
  }
  [[nodiscard]] TROCHOID_INLINE NodeMotion<S> motion(const State<S, kStates>& y) const {
    NodeMotion<S> q;
    q.phi = y[Rim::phi];
    q.at = tilt(body, y[Rim::theta]);
    q.w1 = y[Rim::w1];
    q.w2 = y[Rim::w2];
    q.w3 = y[Rim::w3];
    q.precession_k = q.w2 * q.at.c / q.at.s;
    q.v1 = body.signed_h() * q.w2 - body.R * q.w3;  // (4)
    q.v2 = -body.signed_h() * q.w1;
    q.v3 = body.R * q.w1;
    return q;
  }

  [[nodiscard]] TROCHOID_INLINE RimAcceleration<S> acceleration(const NodeMotion<S>& q) const {
    const auto& [m, A, C, R, half, g, side] = body;
    const double h = body.signed_h(), mhR = m * h * R;
    const S swing = R * q.w2 + h * q.precession_k;
    S b1 = (A * q.precession_k - C * q.w3) * q.w2 + m * swing * q.v1 +
           m * g * (h * q.at.s - R * q.at.c);                       // (5)
    S b2 = (C * q.w3 - A * q.precession_k - m * h * swing) * q.w1;  // (6)
    S b3 = m * R * swing * q.w1;                                    // (7)
    S weight = m * (g - q.at.z * q.w1 * q.w1);                      // N less m (dz/dtheta) dw1
    if constexpr (LossList::kLoad) {
      const Load<S> load = losses.load(body, q);
      b1 += load.t1 + R * load.d3 - h * load.d2;
      b2 += load.t2 + h * load.d1;
      b3 += load.t3 - R * load.d1;
      weight -= q.at.s * load.d2 + q.at.c * load.d3;
    }
    RimAcceleration<S> a;
    const double J1 = A + m * (R * R + h * h);
    if constexpr (LossList::kContact) {
      // The couples are proportional to N, and N to dw1: one linear equation.               (8)
      const ContactCouple<S> couple = losses.contact_couple(q);
      a.w1 = (b1 + couple.k1 * weight) / (J1 - m * q.at.slope * couple.k1);
      a.normal = weight + m * q.at.slope * a.w1;
      b2 += a.normal * couple.k2;
      b3 += a.normal * couple.k3;
    } else {
      a.w1 = b1 * (1.0 / J1);
      a.normal = weight + m * q.at.slope * a.w1;
    }
    const double inverse = 1.0 / (A * C + m * R * R * A + m * h * h * C);
    a.w2 = ((C + m * R * R) * b2 + mhR * b3) * inverse;
    a.w3 = (mhR * b2 + (A + m * h * h) * b3) * inverse;
    return a;
  }

  void derivative(double, const State<S, kStates>& y, State<S, kStates>& dy) const {
    widely<S>([&]() TROCHOID_LAMBDA_INLINE { rates(y, dy); });
  }

  TROCHOID_INLINE void rates(const State<S, kStates>& y, State<S, kStates>& dy) const {
    const NodeMotion<S> q = motion(y);
    const RimAcceleration<S> a = acceleration(q);
    const S cos_phi = cos(y[Rim::phi]), sin_phi = sin(y[Rim::phi]);
    const S vt = -q.at.z * q.w1;
    dy[Rim::phi] = q.w2 / q.at.s;  // (1)
    dy[Rim::theta] = q.w1;
    dy[Rim::psi] = q.w3 - q.precession_k;
    dy[Rim::w1] = a.w1;
    dy[Rim::w2] = a.w2;
    dy[Rim::w3] = a.w3;
    dy[Rim::x] = q.v1 * cos_phi - vt * sin_phi;
    dy[Rim::y] = q.v1 * sin_phi + vt * cos_phi;
  }

  /// Force of the floor, from the acceleration of the centre of mass (10).
  [[nodiscard]] ContactForce<S> contact_force(const NodeMotion<S>& q,
                                              const RimAcceleration<S>& a) const {
    const double m = body.m, R = body.R, h = body.signed_h(), g = body.g;
    Load<S> load;
    if constexpr (LossList::kLoad) load = losses.load(body, q);
    const S f1 = m * (h * a.w2 - R * a.w3 + (R * q.w2 + h * q.precession_k) * q.w1) - load.d1;
    const S f2 = m * (q.precession_k * q.v1 - h * a.w1 - R * q.w1 * q.w1 + g * q.at.s) - load.d2;
    const S f3 = m * (R * a.w1 - h * q.w1 * q.w1 - q.w2 * q.v1 + g * q.at.c) - load.d3;
    return {f2 * q.at.s + f3 * q.at.c, f1, f2 * q.at.c - f3 * q.at.s};
  }

  /// Face contact, the other rim's touch, lift-off, and friction beyond what the floor can give.
  void events(double, const State<S, kStates>& y, State<S, kEvents>& g) const {
    const NodeMotion<S> q = motion(y);
    const RimAcceleration<S> a = acceleration(q);
    g[flat] = q.at.s - kFlat_rad;
    g[rim] = body.h > 0.0 ? body.side * q.at.c : S(1.0);
    g[lift_off] = a.normal * (1.0 / (body.m * body.g));
    g[slip] = S(1.0);
    if (value_of(friction) > 0.0) {
      const ContactForce<S> force = contact_force(q, a);
      const S demand =
          sqrt(force.along_n * force.along_n + force.along_mh * force.along_mh + 1e-300);
      g[slip] = (friction * force.normal - demand) * (1.0 / (body.m * body.g));
    }
  }
};

}  // namespace TROCHOID_ISA
}  // namespace trochoid::model
