#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace trochoid::data {

/// A point of a recording, as options and scenes name it: a frame or a time, one of the two.
struct Moment {
  std::optional<std::int64_t> frame;  ///< 0-based, >= 0
  std::optional<double> t_s;          ///< finite; below 0 only in tracks that count from an event
};

/// @returns the moment a text names, seconds ("1.5") or a frame ("f120"); std::nullopt if neither.
[[nodiscard]] std::optional<Moment> parse_moment(std::string_view text);

/// The part of a recording or track between two moments, both included; nothing = open.
struct Window {
  std::optional<Moment> from, to;

  /// Known only where both ends are times, or both frames.
  [[nodiscard]] bool reversed() const;
};

/// Empty texts leave their end open.
/// @throws InputError if one is no moment or they are reversed; it calls them `from` and `to`, as
/// options, scenes and Python do.
[[nodiscard]] Window parse_window(const std::string& from, const std::string& to);
/// The same of a recording, whose times are counted from its first picture on: none is below 0.
[[nodiscard]] Window parse_recording_window(const std::string& from, const std::string& to);

}  // namespace trochoid::data
