#pragma once
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "trochoid/data/scene.hpp"
#include "trochoid/data/track.hpp"
#include "trochoid/tracking/effort.hpp"

namespace trochoid::tracking {

struct TrackOptions {
  int objects = 1;
  std::string from, to;
  Effort effort = Effort::normal;
  std::optional<std::filesystem::path> edges;  ///< CSV of accepted edge points per frame
  /// Decoded pictures held in memory at once [bytes], but never fewer than 32 pictures: bodies are
  /// sought, and followed backwards, within what is held.
  std::size_t held_bytes = std::size_t{96} << 20;
  /// Called with frames done and frames promised (0 = unknown); may be empty.
  std::function<void(std::int64_t done, std::int64_t total)> progress;
};

/// What happened while tracking, for the report.
struct TrackSummary {
  std::int64_t frames = 0, found = 0, lost = 0, doubtful = 0, damaged = 0;
  std::string camera_words;  ///< how metres were obtained
};

struct TrackResult {
  data::TrackFile file;
  TrackSummary summary;
};

/// Video -> CoM per frame. The scene may be empty: then pixels only. `camera` overrides the
/// scene's.
/// @throws InputError for an unreadable video or camera; a body never seen is an InputError too.
[[nodiscard]] TrackResult track_video(const std::filesystem::path& video, const data::Scene& scene,
                                      const std::optional<data::Camera>& camera,
                                      const TrackOptions& options = {});

}  // namespace trochoid::tracking
