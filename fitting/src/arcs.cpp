#include "arcs.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>

#include "trochoid/data/error.hpp"

namespace trochoid::fitting {
namespace {

struct Bound {
  double value = 0.0;
  bool frame = false;
};

Bound parse_bound(const std::string& text, const char* option) {
  Bound bound{0.0, text.starts_with("f")};
  const char* first = text.data() + (bound.frame ? 1 : 0);
  const char* last = text.data() + text.size();
  const auto [end, code] = std::from_chars(first, last, bound.value);
  if (code != std::errc{} || end != last || !std::isfinite(bound.value))
    throw InputError(fmt::format("--{} {}: give seconds (1.5) or a frame (f120)", option, text));
  return bound;
}

double coordinate(const data::TrackSample& sample, const Bound& bound) {
  return bound.frame ? static_cast<double>(sample.frame) : sample.t_s;
}

}  // namespace

SampleRange chosen_range(const data::Track& track, const std::string& from, const std::string& to) {
  int first = 0, last = static_cast<int>(track.samples.size());
  std::optional<Bound> low, high;
  if (!from.empty()) low = parse_bound(from, "from");
  if (!to.empty()) high = parse_bound(to, "to");
  if (low && high && low->frame == high->frame && low->value > high->value)
    throw InputError(fmt::format("--from {} lies after --to {}; exchange them", from, to));
  while (low && first < last && coordinate(track.samples[first], *low) < low->value) ++first;
  while (high && last > first && coordinate(track.samples[last - 1], *high) > high->value) --last;
  if (first >= last && track.samples.empty())
    throw InputError(fmt::format("object {} has no sample", track.object));
  if (first >= last) {
    const data::TrackSample &start = track.samples.front(), &end = track.samples.back();
    throw InputError(fmt::format(
        "no sample of object {} lies {}{}{}{}{}: its track runs from {:.4g} to {:.4g} s{}",
        track.object, from.empty() ? "" : "from ", from, from.empty() || to.empty() ? "" : " ",
        to.empty() ? "" : "to ", to, start.t_s, end.t_s,
        start.frame < 0 ? "" : fmt::format(", frames {} to {}", start.frame, end.frame)));
  }
  return {first, last};
}

int kept_samples(int first, int last, double hold_back) {
  const double kept = (1.0 - hold_back) * static_cast<double>(last - first);
  return std::max(first + 1, first + static_cast<int>(std::lround(kept)));
}

}  // namespace trochoid::fitting
