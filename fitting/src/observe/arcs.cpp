#include "observe/arcs.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "trochoid/data/error.hpp"
#include "trochoid/data/moment.hpp"

namespace trochoid::fitting {
namespace {

bool before(const data::TrackSample& sample, const data::Moment& moment) {
  return moment.frame ? sample.frame < *moment.frame : sample.t_s < *moment.t_s;
}

bool after(const data::TrackSample& sample, const data::Moment& moment) {
  return moment.frame ? sample.frame > *moment.frame : sample.t_s > *moment.t_s;
}

}  // namespace

SampleRange chosen_range(const data::Track& track, const std::string& from, const std::string& to) {
  int first = 0, last = static_cast<int>(track.samples.size());
  const data::Window window = data::parse_window(from, to);
  while (window.from && first < last && before(track.samples[first], *window.from)) ++first;
  while (window.to && last > first && after(track.samples[last - 1], *window.to)) --last;
  if (first >= last && track.samples.empty())
    throw TrackError(fmt::format("object {} has no sample", track.object));
  if (first >= last) {
    const data::TrackSample &start = track.samples.front(), &end = track.samples.back();
    std::string frames;
    if (start.frame >= 0)
      frames = fmt::format(", frames {} to {}", start.frame, end.frame);
    else if (from.starts_with('f') || to.starts_with('f'))
      frames = ", in a file without a column frame";
    throw TrackError(fmt::format(
        "no sample of object {} lies {}{}{}{}{}: its track runs from {:.4g} to {:.4g} s{}",
        track.object, from.empty() ? "" : "from ", from, from.empty() || to.empty() ? "" : " ",
        to.empty() ? "" : "to ", to, start.t_s, end.t_s, frames));
  }
  return {first, last};
}

int kept_samples(int first, int last, double hold_back) {
  if (!(hold_back >= 0.0 && hold_back < 1.0))
    throw InputError(
        fmt::format("hold_back = {} must be a share, at least 0 and below 1", hold_back));
  const double kept = (1.0 - hold_back) * static_cast<double>(last - first);
  return std::max(first + 1, first + static_cast<int>(std::lround(kept)));
}

}  // namespace trochoid::fitting
