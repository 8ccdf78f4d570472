#pragma once
#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

/// Small helpers of the readers and writers; private to this module.
namespace trochoid::data {

/// `text` in single quotes for a message: control characters and bytes outside ASCII become '?',
/// long text is clipped, so that an error stays one readable line whatever the file holds.
[[nodiscard]] std::string in_quotes(std::string_view text);
/// The same without the quotes, for sentences made by a parser.
[[nodiscard]] std::string one_line(std::string_view text, std::size_t limit = 200);

/// "; did you mean radius_m?" where a candidate is `word` but for a slip (an edit distance of at
/// most half of the longer one's length); else `otherwise`.
[[nodiscard]] std::string guess_meant(std::string_view word,
                                      std::span<const std::string> candidates,
                                      const std::string& otherwise = "");

[[nodiscard]] std::string join(std::span<const std::string> words, std::string_view separator);
[[nodiscard]] std::string_view trimmed(std::string_view text);

/// Shortest text that reads back as the same double, e.g. "0.1"; "nan", "inf" for the others.
[[nodiscard]] std::string shortest(double value);

}  // namespace trochoid::data
