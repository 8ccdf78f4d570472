#pragma once
#include "trochoid/model/events.hpp"

/// A disc spinning down on a fixed pivot (M7): dry, viscous and quadratic resistance over the axial
/// moment. Equation numbers of model/theory/pivot.md.
namespace trochoid::model {
inline namespace TROCHOID_ISA {

template <class S>
struct Pivot {
  using Scalar = S;
  static constexpr int kStates = 2;
  static constexpr int kEvents = 1;
  enum Component : int { psi, speed };  ///< angle turned in the sense of the spin, |w|

  S dry_rad_s2{0.0}, viscous_1_s{0.0}, quadratic_1_rad{0.0};

  [[nodiscard]] Pivot<double> values() const {
    return {value_of(dry_rad_s2), value_of(viscous_1_s), value_of(quadratic_1_rad)};
  }
  /// (1); the polynomial runs on below |w| = 0, where the event ends it.
  void derivative(double, const State<S, 2>& y, State<S, 2>& dy) const {
    dy[psi] = y[speed];
    dy[speed] = -(dry_rad_s2 + (viscous_1_s + quadratic_1_rad * y[speed]) * y[speed]);
  }
  void events(double, const State<S, 2>& y, State<S, 1>& g) const { g[0] = y[speed]; }
};

}  // namespace TROCHOID_ISA
}  // namespace trochoid::model
