#pragma once
#include <cmath>

namespace trochoid::model {

/// Integral of exp(-g s) over [0, t] and its derivative by g: the turns left under linear drag.
struct Decay {
  double integral, by_rate;
};

/// @param rate_1_s g, >= 0 @param t_s t, of any sign
inline Decay decay(double rate_1_s, double t_s) {
  const double x = rate_1_s * t_s;
  // Next to x = 0 the closed form of the derivative loses 1e-16/x^2 of it; the series' next term is
  // x^6/2880 of it.
  if (std::abs(x) < 1e-2)
    return {
        t_s * (1.0 - x * (1.0 / 2 - x * (1.0 / 6 - x * (1.0 / 24 - x * (1.0 / 120 - x / 720))))),
        t_s * t_s *
            (-1.0 / 2 +
             x * (1.0 / 3 - x * (1.0 / 8 - x * (1.0 / 30 - x * (1.0 / 144 - x / 840)))))};
  const double integral = -std::expm1(-x) / rate_1_s;
  return {integral, (t_s * std::exp(-x) - integral) / rate_1_s};
}

}  // namespace trochoid::model
