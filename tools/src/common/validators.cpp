#include "common/validators.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <limits>
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

CLI::Validator number_within(double lower, double upper) {
  return number(fmt::format("a number from {:g} to {:g}", lower, upper),
                fmt::format("{:g} - {:g}", lower, upper),
                [=](double value) { return value >= lower && value <= upper; });
}

CLI::Validator whole_number_within(std::int64_t lower, std::uint64_t upper) {
  return {[=](const std::string& text) {
            std::int64_t small = 0;
            std::uint64_t large = 0;
            const char* const end = text.data() + text.size();
            const auto is_whole = [&](auto& value) {
              const auto [rest, error] = std::from_chars(text.data(), end, value);
              return error == std::errc() && rest == end;
            };
            const bool good = (is_whole(large) && large <= upper &&
                               (lower <= 0 || large >= static_cast<std::uint64_t>(lower))) ||
                              (is_whole(small) && small < 0 && small >= lower);
            return good ? std::string()
                        : fmt::format("'{}' is not a whole number from {} to {}", text, lower,
                                      upper);
          },
          fmt::format("{} - {}", lower, upper)};
}

CLI::Validator seed() {
  return whole_number_within(0, std::numeric_limits<std::uint64_t>::max())
      .description("");  // whoever leaves the range is told; help would only grow long
}

CLI::Validator whole_number() {
  return whole_number_within(0, std::numeric_limits<int>::max()).description("");
}

CLI::Validator frame_rate() {
  return number_within(kSlowest_Hz, kFastest_Hz);
}

CLI::Validator without_slash() {
  return CLI::Validator(
      [](std::string& path) {
        while (path.size() > 1 && path.back() == '/') path.pop_back();
        return std::string();
      },
      "");
}

CLI::Validator fitted_model() {
  return CLI::IsMember({"top", "smooth", "rolling", "sliding", "puck", "pivot", "auto"});
}

}  // namespace trochoid::tools
