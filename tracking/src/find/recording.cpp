#include "find/recording.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

#include "trochoid/data/error.hpp"

namespace trochoid::tracking {
namespace {

constexpr std::size_t kBackgroundSamples = Background::kSamples;
/// However large the pictures are: enough for the background, and more than what windows share.
constexpr std::size_t kLeastFrames = 2 * kBackgroundSamples;

std::size_t bytes_of(const Frame& frame) {
  return frame.luma.total() + 2 * frame.chroma.total();
}

/// `count` frames evenly spread over many.
std::vector<Frame> spread(const std::vector<Frame>& frames, std::size_t count) {
  std::vector<Frame> chosen;
  count = std::min(count, frames.size());
  for (std::size_t k = 0; k < count; ++k)
    chosen.push_back(frames[(2 * k + 1) * frames.size() / (2 * count)]);
  return chosen;
}

}  // namespace

Recording::Recording(const std::filesystem::path& path, const SourceOptions& options,
                     std::size_t held_bytes, std::function<void()> checkpoint)
    : path_(path),
      options_(options),
      held_bytes_(held_bytes),
      checkpoint_(std::move(checkpoint)),
      source_(decode_ahead(open_video(path, options))) {}

std::optional<Frame> Recording::next_of(FrameSource& source) const {
  if (checkpoint_) checkpoint_();
  return source.next();
}

bool Recording::advance(std::size_t keep, const std::function<void(const Frame&)>& each) {
  if (ended_) return false;
  std::size_t bytes = 0, fresh = 0;
  keep = std::min(keep, window_.size());
  for (auto k = window_.size() - keep; k < window_.size(); ++k) bytes += bytes_of(window_[k]);
  while (bytes < held_bytes_ || keep + fresh < kLeastFrames) {
    auto frame = next_of(*source_);
    if (!frame) {
      ended_ = true;
      break;
    }
    if (fresh++ == 0) {
      remember_window();
      window_.erase(window_.begin(), window_.end() - static_cast<std::ptrdiff_t>(keep));
    }
    repeats_.add(frame->luma);
    if (each) each(*frame);
    bytes += bytes_of(*frame);
    window_.push_back(std::move(*frame));
  }
  return fresh > 0;
}

/// A few pictures of the window that is about to go.
void Recording::remember_window() {
  if (window_.empty() || !sampled_) return;
  std::vector<Frame> some = spread(window_, kBackgroundSamples / 4);
  std::move(some.begin(), some.end(), std::back_inserter(elsewhere_));
  if (elsewhere_.size() > kBackgroundSamples)
    elsewhere_ = spread(elsewhere_, kBackgroundSamples / 2);
}

/// A long recording has many frames that decode alone; keeps some of those that a quick look shows.
/// What cannot be read is told when it is its turn, and may lie beyond the end that was asked for.
void Recording::read_ahead() try {
  if (std::exchange(looked_ahead_, true)) return;
  SourceOptions options = options_;
  options.key_frames_only = true;
  options.from.clear();
  options.to.clear();
  const auto keys = open_video(path_, options);
  while (auto frame = next_of(*keys)) {
    elsewhere_.push_back(std::move(*frame));
    if (elsewhere_.size() >= kBackgroundSamples)
      elsewhere_ = spread(elsewhere_, kBackgroundSamples / 2);
  }
} catch (const InputError&) {
}

void Recording::stop_sampling() {
  sampled_ = false;
  elsewhere_.clear();
}

bool Recording::leave_out_the_rest() {
  if (!is_part() || rest_left_out_ || !looked_ahead_) return false;
  rest_left_out_ = true;
  elsewhere_.clear();
  return true;
}

BackgroundSamples Recording::samples() {
  const bool all = elsewhere_.empty() && ((ended_ && !is_part()) || rest_left_out_);
  std::vector<Frame> chosen = spread(window_, all ? kBackgroundSamples : kBackgroundSamples / 2);
  if (!all) {
    read_ahead();
    std::vector<Frame> others = spread(elsewhere_, kBackgroundSamples / 2);
    std::move(others.begin(), others.end(), std::back_inserter(chosen));
  }
  BackgroundSamples samples;
  const bool coloured =
      std::none_of(chosen.begin(), chosen.end(), [](const Frame& f) { return f.chroma.empty(); });
  for (const Frame& frame : chosen) {
    samples.luma.push_back(frame.luma);
    if (coloured) samples.chroma.push_back(frame.chroma);
  }
  return samples;
}

}  // namespace trochoid::tracking
