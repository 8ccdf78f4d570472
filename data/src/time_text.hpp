#pragma once
#include <charconv>
#include <cmath>
#include <cstdint>
#include <string_view>

namespace trochoid::data {

/// Whether `text` is a point of a recording: seconds >= 0 ("1.5") or a frame ("f120").
inline bool is_time_or_frame(std::string_view text) {
  const bool frame = text.starts_with('f');
  const char* first = text.data() + (frame ? 1 : 0);
  const char* last = text.data() + text.size();
  double seconds = 0.0;
  std::int64_t index = 0;
  const auto [end, error] =
      frame ? std::from_chars(first, last, index) : std::from_chars(first, last, seconds);
  return error == std::errc() && end == last && index >= 0 && seconds >= 0.0 &&
         std::isfinite(seconds);
}

}  // namespace trochoid::data
