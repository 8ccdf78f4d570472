#pragma once
#include <CLI/CLI.hpp>

namespace trochoid::tools {

/// Finite numbers > 0, and >= 0; the refusal repeats the value and says what would be right
/// (CLI11's own spell out the largest double).
[[nodiscard]] CLI::Validator positive_number();
[[nodiscard]] CLI::Validator non_negative_number();

/// Numbers from `lower` to `upper`.
[[nodiscard]] CLI::Validator number_within(double lower, double upper);
/// Pictures per second, from a time lapse's to more than cameras reach.
[[nodiscard]] CLI::Validator frame_rate();

/// A model that can be fitted, or auto.
[[nodiscard]] CLI::Validator fitted_model();

}  // namespace trochoid::tools
