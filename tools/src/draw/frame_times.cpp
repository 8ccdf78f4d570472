#include "draw/frame_times.hpp"

#include <algorithm>
#include <map>

#include "trochoid/data/quantile.hpp"

namespace trochoid::tools {
namespace {

// Stamps jitter, or come in pairs; means over a few frames hardly do. Some of these are longer for
// a frame that was lost or a camera that was slow.
std::optional<double> usual_step_of(const std::vector<std::pair<std::int64_t, double>>& known) {
  constexpr std::size_t kFrames = 8;
  constexpr double kShort = 0.25;
  std::vector<double> means_s;
  for (std::size_t i = kFrames; i < known.size(); ++i)
    means_s.push_back((known[i].second - known[i - kFrames].second) /
                      static_cast<double>(known[i].first - known[i - kFrames].first));
  if (means_s.empty()) return std::nullopt;
  return data::quantile(std::move(means_s), kShort);
}

}  // namespace

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
  frame_s_ = data::median(std::move(steps_s));
  usual_s_ = usual_step_of(known_).value_or(frame_s_);
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
