#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "link/track_assembly.hpp"
#include "trochoid/data/camera.hpp"
#include "trochoid/data/table.hpp"
#include "trochoid/data/track.hpp"
#include "trochoid/tracking/frame_source.hpp"

namespace trochoid::tracking {

/// What reading a recording from end to end has shown of it.
struct WhatWasRead {
  std::int64_t frames = 0;         ///< pictures
  std::int64_t missing = 0;        ///< between them, by their time stamps
  std::int64_t repeated = 0;       ///< that are the same as the one before
  double exposure_fraction = 0.0;  ///< shutter time over frame interval, as the scene has it
};

/// What a user should know of a recording before trusting times and blur.
[[nodiscard]] std::vector<std::string> notes_about_recording(const VideoInfo& video,
                                                             const WhatWasRead& read);

/// What a user should know of what was measured in it: edges that lie to one side, outlines too
/// small for a tilt.
/// @param camera of poses; may be null if there are none.  @param tracks of the paths.
[[nodiscard]] std::vector<std::string> notes_about_measurement(
    const std::vector<BodyPath>& paths, const std::vector<data::Track>& tracks,
    const data::Camera* camera);

/// The accepted edge points of all frames [px].
[[nodiscard]] data::Table edge_table(const std::vector<BodyPath>& paths);

}  // namespace trochoid::tracking
