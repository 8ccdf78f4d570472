#pragma once
#include <cstddef>
#include <vector>

namespace trochoid::tracking {

/// Value at t of the polynomial through all the values [Lagrange]. Times have to differ.
template <class Value>
Value through(const std::vector<double>& times, const std::vector<Value>& values, double t) {
  Value sum = 0.0 * values[0];
  for (std::size_t k = 0; k < times.size(); ++k) {
    double weight = 1.0;
    for (std::size_t l = 0; l < times.size(); ++l)
      if (l != k) weight *= (t - times[l]) / (times[k] - times[l]);
    sum += weight * values[k];
  }
  return sum;
}

}  // namespace trochoid::tracking
