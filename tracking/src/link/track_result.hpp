#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <vector>

#include "find/background.hpp"
#include "find/recording.hpp"
#include "link/track_assembly.hpp"
#include "link/track_notes.hpp"
#include "trochoid/data/camera.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/tracking/tracker.hpp"

namespace trochoid::tracking {

/// Whether the body's outline is known, so that with a camera it is measured as a cylinder.
[[nodiscard]] inline bool has_shape(const data::Scene& scene) {
  return scene.body && scene.body->radius_m > 0.0;
}

/// A recording in which bodies were followed from end to end.
struct FollowedRecording {
  const std::filesystem::path& video;
  const data::Scene& scene;
  const std::optional<data::Camera>& camera;
  double readout_s = 0.0;      ///< rolling shutter: time from the first to the last row
  const Recording& recording;  ///< with its last window
  const Background& background;
  WhatWasRead read{};
  FramesRead span{};
  std::optional<double> seen_exposure{};  ///< over the frame interval, by how edges are smeared
  std::map<std::int64_t, PictureShift> shifts{};  ///< of a camera that moves
};

/// The tracks of the bodies' paths, how many of their frames are lost and doubtful, and what a user
/// should know of them. Rows that a rolling shutter read in turn are allowed for, in the paths.
[[nodiscard]] TrackResult make_tracks(const FollowedRecording& followed,
                                      std::vector<BodyPath>& paths, const TrackOptions& options);

}  // namespace trochoid::tracking
