#include "draw/frame_times.hpp"

#include <algorithm>
#include <iterator>
#include <map>
#include <numeric>

#include "trochoid/data/quantile.hpp"

namespace trochoid::tools {

FrameTimes::FrameTimes(const data::TrackFile& tracks) {
  std::map<std::int64_t, double> times;
  for (const data::Track& track : tracks.tracks)
    for (const data::TrackSample& sample : track.samples)
      if (sample.frame >= 0) times.emplace(sample.frame, sample.t_s);
  known_.assign(times.begin(), times.end());
  std::vector<double> steps_s;
  for (std::size_t i = 1; i < known_.size(); ++i)
    steps_s.push_back((known_[i].second - known_[i - 1].second) /
                      static_cast<double>(known_[i].first - known_[i - 1].first));
  if (steps_s.empty()) return;
  // Stamps jitter, by their rounding if by nothing else: the mean of those about as short as most.
  constexpr double kShort = 0.1, kAboutAsShort = 1.5;
  const double most_s = kAboutAsShort * data::quantile(steps_s, kShort);
  const auto longer =
      std::partition(steps_s.begin(), steps_s.end(), [=](double s) { return s <= most_s; });
  shortest_s_ = std::accumulate(steps_s.begin(), longer, 0.0) /
                static_cast<double>(std::distance(steps_s.begin(), longer));
  frame_s_ = data::median(std::move(steps_s));
}

std::optional<double> FrameTimes::time_of(std::int64_t frame) const {
  if (known_.size() < 2) return std::nullopt;
  const auto after =
      std::lower_bound(known_.begin(), known_.end(), frame,
                       [](const auto& known, std::int64_t f) { return known.first < f; });
  if (after == known_.end()) {
    const auto& [last, t_s] = known_.back();
    return t_s + static_cast<double>(frame - last) * frame_s_;
  }
  if (after->first == frame || after == known_.begin())
    return after->second - static_cast<double>(after->first - frame) * frame_s_;
  const auto& [low, low_s] = *std::prev(after);
  const auto& [high, high_s] = *after;
  return low_s +
         (high_s - low_s) * static_cast<double>(frame - low) / static_cast<double>(high - low);
}

std::optional<double> FrameTimes::frame_at(double t_s) const {
  if (known_.size() < 2 || !(frame_s_ > 0.0)) return std::nullopt;
  const auto after = std::lower_bound(known_.begin(), known_.end(), t_s,
                                      [](const auto& known, double t) { return known.second < t; });
  if (after == known_.begin() || after == known_.end()) {
    const auto& [frame, there_s] = after == known_.end() ? known_.back() : known_.front();
    return static_cast<double>(frame) + (t_s - there_s) / frame_s_;
  }
  const auto& [low, low_s] = *std::prev(after);
  const auto& [high, high_s] = *after;
  return static_cast<double>(low) +
         static_cast<double>(high - low) * (t_s - low_s) / (high_s - low_s);
}

bool FrameTimes::has(std::int64_t frame) const {
  return std::binary_search(known_.begin(), known_.end(), std::pair(frame, 0.0),
                            [](const auto& a, const auto& b) { return a.first < b.first; });
}

}  // namespace trochoid::tools
