#include "recording.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

#include "trochoid/data/error.hpp"

namespace trochoid::tracking {

Recording::Recording(const std::filesystem::path& path, const SourceOptions& options)
    : path_(path), options_(options), source_(decode_ahead(open_video(path, options))) {
  std::size_t bytes = 0;
  while (auto frame = source_->next()) {
    const std::size_t size = frame->luma.total() + 2 * frame->chroma.total();
    if (bytes + size > kHeldBytes && held_.size() >= 2 * Background::kSamples) {
      first_after_ = std::move(frame);
      more_ = true;
      break;
    }
    bytes += size;
    held_.push_back(std::move(*frame));
  }
  if (held_.empty())
    throw InputError(fmt::format("{}: no frame between --from and --to", path.string()));
}

std::optional<Frame> Recording::next() {
  if (first_after_) return std::exchange(first_after_, std::nullopt);
  return source_->next();
}

BackgroundSamples Recording::samples() const {
  BackgroundSamples chosen;
  bool coloured = true;
  const auto choose = [&](const Frame& frame) {
    chosen.luma.push_back(frame.luma);
    chosen.chroma.push_back(frame.chroma);
    coloured = coloured && !frame.chroma.empty();
  };
  const auto from_held = [&](std::size_t count) {
    for (std::size_t k = 0; k < count; ++k) choose(held_[(2 * k + 1) * held_.size() / (2 * count)]);
    if (!coloured) chosen.chroma.clear();
  };
  const auto wanted = static_cast<std::size_t>(Background::kSamples);
  if (!more_) {
    from_held(std::min(wanted, held_.size()));
    return chosen;
  }
  from_held(wanted / 2);
  // A long recording has many frames that decode alone; keep every n-th, doubling n when full.
  SourceOptions options = options_;
  options.key_frames_only = true;
  options.from.clear();
  options.to.clear();
  const auto keys = open_video(path_, options);
  std::vector<Frame> later;
  std::size_t stride = 1, count = 0;
  while (auto frame = keys->next()) {
    if (count++ % stride != 0) continue;
    later.push_back(std::move(*frame));
    if (later.size() < 2 * wanted) continue;
    for (std::size_t k = 0; k < wanted; ++k) later[k] = std::move(later[2 * k]);
    later.resize(wanted);
    stride *= 2;
  }
  const std::size_t share = std::min(later.size(), wanted / 2);
  for (std::size_t k = 0; k < share; ++k) choose(later[(2 * k + 1) * later.size() / (2 * share)]);
  if (!coloured) chosen.chroma.clear();
  return chosen;
}

}  // namespace trochoid::tracking
