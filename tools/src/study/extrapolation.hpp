#pragma once
#include <Eigen/Core>
#include <array>
#include <cmath>

namespace trochoid::tools {

using Real = long double;
template <int N>
using RealVector = Eigen::Matrix<Real, N, 1>;

/// Gragg's method with Aitken-Neville extrapolation (GBS), order 2 kRows, on 80-bit numbers; step
/// control by the last two columns of the tableau [HairerNorsettWanner1993, II.9]. Kept for
/// reference solutions: simple, and as exact as the numbers allow.
template <int N, class Derivative>
class Extrapolation {
 public:
  using Y = RealVector<N>;
  Extrapolation(Derivative derivative, Real tolerance) : f_(derivative), tolerance_(tolerance) {}

  /// Advances y from t to t_end. @returns false if a step would have to be shorter than rounding.
  bool advance(Real& t, Y& y, Real t_end) {
    while (t < t_end) {
      const Real h = std::min(h_, t_end - t);
      Real error = 0;
      const Y next = step(t, y, h, error);
      if (!(error <= 1)) {
        h_ = h *
             (std::isfinite(error) ? std::max<Real>(0.2L, 0.9L * std::pow(error, kPower)) : 0.1L);
        if (h_ < 1e-17L * (1 + std::abs(t))) return false;
        continue;
      }
      t = h < t_end - t ? t + h : t_end;
      y = next;
      const Real factor = std::min<Real>(3, 0.9L * std::pow(std::max<Real>(error, 1e-12L), kPower));
      if (h == h_ || factor < 1) h_ = h * factor;
    }
    return true;
  }

 private:
  static constexpr int kRows = 9;
  static constexpr Real kPower = -1.0L / (2 * kRows - 1);

  [[nodiscard]] Y midpoint(Real t, const Y& y, Real h, int parts) const {
    const Real sub = h / parts;
    Y before = y, now = y + sub * f_(t, y);
    for (int i = 1; i < parts; ++i) {
      const Y after = before + 2 * sub * f_(t + i * sub, now);
      before = now;
      now = after;
    }
    return 0.5L * (before + now + sub * f_(t + h, now));  // Gragg's smoothing
  }

  [[nodiscard]] Y step(Real t, const Y& y, Real h, Real& error) const {
    std::array<Y, kRows> column;
    Y previous = y;
    for (int row = 0; row < kRows; ++row) {
      const Real parts = 2 * (row + 1);
      Y value = midpoint(t, y, h, 2 * (row + 1));
      for (int k = 0; k < row; ++k) {
        const Real ratio = parts / (2 * (row - k));
        const Y better =
            value + (value - column[static_cast<std::size_t>(k)]) / (ratio * ratio - 1);
        column[static_cast<std::size_t>(k)] = value;
        value = better;
      }
      previous = row > 0 ? column[static_cast<std::size_t>(row - 1)] : value;
      column[static_cast<std::size_t>(row)] = value;
    }
    const Y& best = column[kRows - 1];
    const Y scale = (tolerance_ * (1 + best.array().abs().max(y.array().abs()))).matrix();
    error = ((best - previous).array() / scale.array()).abs().maxCoeff();
    return best;
  }

  Derivative f_;
  Real tolerance_;
  Real h_ = 1e-3L;
};

}  // namespace trochoid::tools
