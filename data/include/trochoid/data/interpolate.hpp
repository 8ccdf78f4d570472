#pragma once
#include <cstddef>
#include <span>

namespace trochoid::data {

/// Value at t of the polynomial through all the values, in Lagrange's form.
/// @param times  all different; as many as values, at least one.
template <class Value>
[[nodiscard]] Value polynomial_at(std::span<const double> times, std::span<const Value> values,
                                  double t) {
  Value sum = 0.0 * values[0];
  for (std::size_t k = 0; k < times.size(); ++k) {
    double weight = 1.0;
    for (std::size_t l = 0; l < times.size(); ++l)
      if (l != k) weight *= (t - times[l]) / (times[k] - times[l]);
    sum += weight * values[k];
  }
  return sum;
}

}  // namespace trochoid::data
