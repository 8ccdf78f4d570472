#pragma once
#include <string>

namespace trochoid::tools {

/// "0.0450 ± 0.0003" or "(3.1 ± 0.2) × 10^-5": as many digits as the error justifies (two of it).
/// Without an error (fixed, or not seen) six digits of the value.
[[nodiscard]] std::string value_words(double value, double sigma);
/// A unit behind a value: nothing for "1", which would look like another digit.
[[nodiscard]] std::string unit_words(const std::string& unit);
/// "0.034", "1.2e-05": short, for tables.
[[nodiscard]] std::string short_number(double value);

}  // namespace trochoid::tools
