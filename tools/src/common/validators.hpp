#pragma once
#include <CLI/CLI.hpp>
#include <cstdint>

namespace trochoid::tools {

/// Finite numbers > 0; the refusal repeats the value and says what would be right (CLI11's own
/// spells out the largest double).
[[nodiscard]] CLI::Validator positive_number();

/// Numbers from `lower` to `upper`.
[[nodiscard]] CLI::Validator number_within(double lower, double upper);
/// Whole numbers from `lower` to `upper`; from 0 on; and those that seed random numbers.
[[nodiscard]] CLI::Validator whole_number_within(std::int64_t lower, std::uint64_t upper);
[[nodiscard]] CLI::Validator whole_number();
[[nodiscard]] CLI::Validator seed();
/// Pictures per second, from a time lapse's to more than cameras reach.
inline constexpr double kSlowest_Hz = 1e-6, kFastest_Hz = 1e9;
[[nodiscard]] CLI::Validator frame_rate();

/// Takes the slash off the name of a folder, which has a name of its own without it.
[[nodiscard]] CLI::Validator without_slash();

/// A model that can be fitted, or auto.
[[nodiscard]] CLI::Validator fitted_model();

}  // namespace trochoid::tools
