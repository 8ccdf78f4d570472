#include "validators.hpp"

#include <fmt/format.h>

#include <cmath>
#include <string>

namespace trochoid::tools {
namespace {

template <class Accepts>
CLI::Validator number(const std::string& words, const std::string& description,
                      const Accepts& accepts) {
  return {[=](const std::string& text) {
            double value = 0.0;
            const bool good =
                CLI::detail::lexical_cast(text, value) && std::isfinite(value) && accepts(value);
            return good ? std::string() : "'" + text + "' is not " + words;
          },
          description};
}

}  // namespace

CLI::Validator positive_number() {
  return number("a number greater than 0", "POSITIVE", [](double value) { return value > 0.0; });
}

CLI::Validator non_negative_number() {
  return number("a number of 0 or greater", "NONNEGATIVE",
                [](double value) { return value >= 0.0; });
}

CLI::Validator number_within(double lower, double upper) {
  return number(fmt::format("a number from {:g} to {:g}", lower, upper),
                fmt::format("{:g} - {:g}", lower, upper),
                [=](double value) { return value >= lower && value <= upper; });
}

CLI::Validator frame_rate() {
  constexpr double kSlowest_Hz = 1e-6, kFastest_Hz = 1e9;
  return number_within(kSlowest_Hz, kFastest_Hz);
}

CLI::Validator fitted_model() {
  return CLI::IsMember({"top", "smooth", "rolling", "sliding", "puck", "pivot", "auto"});
}

}  // namespace trochoid::tools
