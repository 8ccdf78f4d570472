#pragma once
#include "trochoid/model/dormand_prince.hpp"
#include "trochoid/model/dual.hpp"
#include "trochoid/model/taylor.hpp"

namespace trochoid::model {
inline namespace TROCHOID_ISA {

/// Torque-free body (rungs M0 and M1): Euler's equations in body axes with the attitude quaternion
/// (body to world); equation numbers of model/theory/torque_free.md.
template <class T>
struct FreeBody {
  using Scalar = T;
  static constexpr int kStates = 7;  ///< wx, wy, wz, qw, qx, qy, qz
  T gx, gy, gz;                      ///< (Iy - Iz)/Ix and so on

  [[nodiscard]] static FreeBody with_moments(const T& Ix, const T& Iy, const T& Iz) {
    return {(Iy - Iz) / Ix, (Iz - Ix) / Iy, (Ix - Iy) / Iz};
  }
  void derivative(double, const State<T, 7>& y, State<T, 7>& dy) const {
    dy[0] = gx * y[1] * y[2];  // (1)
    dy[1] = gy * y[2] * y[0];
    dy[2] = gz * y[0] * y[1];
    dy[3] = -0.5 * (y[4] * y[0] + y[5] * y[1] + y[6] * y[2]);  // (2)
    dy[4] = 0.5 * (y[3] * y[0] + y[5] * y[2] - y[6] * y[1]);
    dy[5] = 0.5 * (y[3] * y[1] + y[6] * y[0] - y[4] * y[2]);
    dy[6] = 0.5 * (y[3] * y[2] + y[4] * y[1] - y[5] * y[0]);
  }
  void series(const Series<T>* y, int n, State<T, 7>& dy) const {
    dy[0] = gx * product(y[1], y[2], n);
    dy[1] = gy * product(y[2], y[0], n);
    dy[2] = gz * product(y[0], y[1], n);
    dy[3] = -0.5 * (product(y[4], y[0], n) + product(y[5], y[1], n) + product(y[6], y[2], n));
    dy[4] = 0.5 * (product(y[3], y[0], n) + product(y[5], y[2], n) - product(y[6], y[1], n));
    dy[5] = 0.5 * (product(y[3], y[1], n) + product(y[6], y[0], n) - product(y[4], y[2], n));
    dy[6] = 0.5 * (product(y[3], y[2], n) + product(y[4], y[1], n) - product(y[5], y[0], n));
  }
  [[nodiscard]] FreeBody<double> values() const {
    return {value_of(gx), value_of(gy), value_of(gz)};
  }
};

}  // namespace TROCHOID_ISA
}  // namespace trochoid::model
