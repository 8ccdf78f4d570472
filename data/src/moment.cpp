#include "trochoid/data/moment.hpp"

#include <fmt/core.h>

#include <charconv>
#include <cmath>

#include "text.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::data {
namespace {

template <class Number>
std::optional<Number> whole_text(std::string_view text) {
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::optional<Moment> end_of_window(const char* name, const std::string& text) {
  if (text.empty()) return std::nullopt;
  const auto moment = parse_moment(text);
  if (!moment)
    throw InputError(
        fmt::format("{} = {}: give seconds (1.5) or a frame (f120)", name, in_quotes(text)));
  return moment;
}

}  // namespace

std::optional<Moment> parse_moment(std::string_view text) {
  if (text.starts_with('f')) {
    const auto frame = whole_text<std::int64_t>(text.substr(1));
    return frame && *frame >= 0 ? std::optional(Moment{frame, {}}) : std::nullopt;
  }
  const auto t_s = whole_text<double>(text);
  return t_s && std::isfinite(*t_s) ? std::optional(Moment{{}, t_s}) : std::nullopt;
}

bool Window::reversed() const {
  if (!from || !to) return false;
  return (from->frame && to->frame && *from->frame > *to->frame) ||
         (from->t_s && to->t_s && *from->t_s > *to->t_s);
}

Window parse_window(const std::string& from, const std::string& to) {
  const Window window{end_of_window("from", from), end_of_window("to", to)};
  if (window.reversed())
    throw InputError(fmt::format("from = {} lies after to = {}; exchange them", from, to));
  return window;
}

Window parse_recording_window(const std::string& from, const std::string& to) {
  const Window window = parse_window(from, to);
  const auto check = [](const char* name, const std::optional<Moment>& moment) {
    if (moment && moment->t_s.value_or(0.0) < 0.0)
      throw InputError(fmt::format(
          "{} = {:g} lies before the recording: its times are counted from its first picture on, "
          "at 0 s",
          name, *moment->t_s));
  };
  check("from", window.from);
  check("to", window.to);
  return window;
}

}  // namespace trochoid::data
