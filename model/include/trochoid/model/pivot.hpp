#pragma once
#include "trochoid/model/events.hpp"

/// A disc spinning down on a fixed pivot (M7): dry, viscous and quadratic resistance over the axial
/// moment, and a weight out of balance. Equation numbers of model/theory/pivot.md.
namespace trochoid::model {
inline namespace TROCHOID_ISA {

/// One stretch of motion in the sense `sense` = sign(w). Unbalanced: gravity pulls at a centre of
/// mass beside the axis, which is not quite upright.
template <class S, bool Unbalanced>
struct Pivot {
  using Scalar = S;
  static constexpr int kStates = 2;
  static constexpr int kEvents = 1;
  enum Component : int { turned, speed };  ///< psi - psi_0 [rad], w = dpsi [rad/s]

  S start_rad{0.0};
  S dry_rad_s2{0.0}, weakening_s_rad{0.0}, viscous_1_s{0.0}, quadratic_1_rad{0.0};
  S sine_rad_s2{0.0}, cosine_rad_s2{0.0};
  double sense = 1.0;

  [[nodiscard]] Pivot<double, Unbalanced> values() const {
    return {value_of(start_rad),       value_of(dry_rad_s2),
            value_of(weakening_s_rad), value_of(viscous_1_s),
            value_of(quadratic_1_rad), value_of(sine_rad_s2),
            value_of(cosine_rad_s2),   sense};
  }
  /// Couple of the weight over the axial moment, the last terms of (1).
  template <class T>
  [[nodiscard]] T weight(const T& turned_rad) const {
    if constexpr (!Unbalanced) return T(0.0);
    const T psi = turned_rad + start_rad;
    return -sine_rad_s2 * sin(psi) - cosine_rad_s2 * cos(psi);
  }
  /// (1); it runs on smoothly beyond w = 0, where the event ends it.
  void derivative(double, const State<S, 2>& y, State<S, 2>& dy) const {
    const S size = y[speed] * sense;
    const S dry = dry_rad_s2 / (1.0 + weakening_s_rad * size);
    dy[turned] = y[speed];
    dy[speed] = (dry + (viscous_1_s + quadratic_1_rad * size) * size) * -sense;
    if constexpr (Unbalanced) dy[speed] += weight(y[turned]);
  }
  void events(double, const State<S, 2>& y, State<S, 1>& g) const { g[0] = y[speed] * sense; }
};

}  // namespace TROCHOID_ISA
}  // namespace trochoid::model
