#include "common/value_words.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace trochoid::tools {

std::string value_words(double value, double sigma) {
  if (!std::isfinite(value)) return "—";
  if (!(sigma > 0.0) || !std::isfinite(sigma)) return fmt::format("{:.6g}", value);
  const int exponent =
      static_cast<int>(std::floor(std::log10(sigma))) - 1;  // of the last digit shown
  const double largest = std::max(std::abs(value), sigma);
  const int power = static_cast<int>(std::floor(std::log10(largest)));
  const bool as_power = largest >= 1e5 || largest < 1e-3;
  constexpr int kMostDecimals = 12;  // more than that only paths without noise give
  if ((as_power ? power : 0) - exponent > kMostDecimals)
    return fmt::format("{:.13g} ± {:.1e}", value, sigma);
  if (as_power) {
    const double unit = std::pow(10.0, power);
    const int decimals = std::max(power - exponent, 0);
    return fmt::format("({:.{}f} ± {:.{}f}) × 10^{}", value / unit, decimals, sigma / unit,
                       decimals, power);
  }
  const int decimals = std::max(-exponent, 0);
  if (std::abs(value) < 0.5 * std::pow(10.0, -decimals)) value = 0.0;  // no "-0.000"
  return fmt::format("{:.{}f} ± {:.{}f}", value, decimals, sigma, decimals);
}

std::string unit_words(const std::string& unit) {
  return unit == "1" ? "" : unit;
}

std::string short_number(double value) {
  return std::isfinite(value) ? fmt::format("{:.5g}", value) : "—";
}

}  // namespace trochoid::tools
