#include "validators.hpp"

#include <cmath>
#include <string>

namespace trochoid::tools {
namespace {

template <class Accepts>
CLI::Validator number(const char* words, const char* description, const Accepts& accepts) {
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

CLI::Validator fitted_model() {
  return CLI::IsMember({"top", "smooth", "rolling", "sliding", "puck", "pivot", "auto"});
}

}  // namespace trochoid::tools
