#pragma once
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "background.hpp"
#include "trochoid/tracking/frame_source.hpp"

namespace trochoid::tracking {

/// A recording as the tracker reads it: its first part held in memory, so that bodies can be sought
/// in any order there and followed backwards, the rest streamed once. How much is held does not
/// depend on the recording's length.
class Recording {
 public:
  /// Pictures held at most [bytes].
  static constexpr std::size_t kHeldBytes = 96u << 20;

  /// Decodes the first part. @throws InputError as open_video does, or if the window holds no
  /// frame.
  Recording(const std::filesystem::path& path, const SourceOptions& options);

  [[nodiscard]] const VideoInfo& info() const { return source_->info(); }
  [[nodiscard]] const std::vector<Frame>& held() const { return held_; }
  /// Lets the held frames go.
  void release() { held_.clear(); }
  /// Next frame after the held ones.
  [[nodiscard]] std::optional<Frame> next();
  /// Pictures spread over the whole recording, for the background: from the held part, and, where
  /// more follows, from the frames of the file that decode alone.
  [[nodiscard]] BackgroundSamples samples() const;

 private:
  std::filesystem::path path_;
  SourceOptions options_;
  std::unique_ptr<FrameSource> source_;
  std::vector<Frame> held_;
  bool more_ = false;
  std::optional<Frame> first_after_;
};

}  // namespace trochoid::tracking
