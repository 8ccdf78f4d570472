#pragma once
#include <algorithm>
#include <cmath>

namespace trochoid::tools {

/// The largest 1, 2 or 5 times a power of ten not above `limit`.
[[nodiscard]] inline double round_length(double limit) {
  const double power = std::pow(10.0, std::floor(std::log10(limit)));
  for (const double factor : {5.0, 2.0})
    if (factor * power <= limit) return factor * power;
  return power;
}

/// The smallest 1, 2 or 5 times a power of ten that divides `span` into at most `parts` parts.
[[nodiscard]] inline double round_step(double span, int parts) {
  const double least = span / std::max(1, parts);
  const double power = std::pow(10.0, std::floor(std::log10(least)));
  for (const double factor : {1.0, 2.0, 5.0})
    if (factor * power >= least) return factor * power;
  return 10.0 * power;
}

/// Digits behind the point that tell multiples of a step apart.
[[nodiscard]] inline int decimals_of_step(double step) {
  return std::max(0, static_cast<int>(-std::floor(std::log10(step) + 1e-9)));
}

}  // namespace trochoid::tools
