#pragma once
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "trochoid/data/scene.hpp"
#include "trochoid/data/table.hpp"
#include "trochoid/data/track.hpp"
#include "trochoid/tracking/effort.hpp"

namespace trochoid::tracking {

/// How to follow; what the scene's [tracking] says as well is combined as told at each field.
struct TrackOptions {
  int objects = 1;  ///< moving bodies, >= 1; the scene's number if that is larger
  /// First and last moment, both included: seconds ("1.5") or frame ("f120"). Each one that is
  /// given replaces the scene's; empty: the scene's, else the recording's own end.
  std::string from, to;
  Effort effort = Effort::normal;
  bool edges = false;  ///< also hand out the accepted edge points: TrackResult::edges
  /// Decoded pictures held in memory at once [bytes], but never fewer than 32 pictures: bodies are
  /// sought, and followed backwards, within what is held.
  std::size_t held_bytes = std::size_t{96} << 20;
  /// Called with frames done and frames promised (0 = unknown); may be empty.
  std::function<void(std::int64_t done, std::int64_t total)> progress;
  /// Called many times a second, from several threads; what it throws ends the work and is thrown
  /// on. May be empty.
  std::function<void()> checkpoint{};
};

/// What happened while tracking, for the report.
struct TrackSummary {
  std::int64_t frames = 0;    ///< pictures looked at, once each
  std::int64_t found = 0;     ///< samples, over all bodies
  std::int64_t lost = 0;      ///< pictures without a sample, counted for each body
  std::int64_t doubtful = 0;  ///< samples with a quality below 0.5, among those found
  std::int64_t damaged = 0;   ///< pictures the decoder found errors in, used all the same
  std::string camera_words;   ///< how metres were obtained
};

struct TrackResult {
  data::TrackFile file;
  TrackSummary summary;
  /// Accepted edge points [px], one row each (docs/formats.md), if TrackOptions::edges asked for
  /// them.
  std::optional<data::Table> edges{};
};

/// Video -> CoM per frame. The scene may be empty: then pixels only. `camera` overrides the
/// scene's.
/// @throws InputError for an unreadable video or camera, and for a readout_s longer than a frame
/// interval; a body never seen is an InputError too.
[[nodiscard]] TrackResult track_video(const std::filesystem::path& video, const data::Scene& scene,
                                      const std::optional<data::Camera>& camera,
                                      const TrackOptions& options = {});

}  // namespace trochoid::tracking
