#pragma once
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "link/track_assembly.hpp"
#include "trochoid/data/camera.hpp"
#include "trochoid/data/table.hpp"
#include "trochoid/tracking/frame_source.hpp"

namespace trochoid::tracking {

/// What reading a recording from end to end has shown of it.
struct WhatWasRead {
  std::int64_t frames = 0;         ///< pictures
  std::int64_t missing = 0;        ///< between them, by their time stamps
  std::int64_t repeated = 0;       ///< that are the same as the one before
  std::int64_t damaged = 0;        ///< that the decoder had to patch
  double exposure_fraction = 0.0;  ///< shutter time over frame interval, as the scene has it
};

/// What a user should know of a recording before trusting times and blur.
[[nodiscard]] std::vector<std::string> notes_about_recording(const VideoInfo& video,
                                                             const WhatWasRead& read);

/// That pixels are not as wide as high, which only a camera's file allows for.
[[nodiscard]] std::optional<std::string> note_about_pixel_aspect(const VideoInfo& video);

/// By how much the camera moves, where it does.
/// @param frames  of the recording.  @param metres  whether its tracks have any.
[[nodiscard]] std::optional<std::string> note_about_camera_motion(
    const std::map<std::int64_t, PictureShift>& shifts, std::int64_t frames, bool metres);

/// Where all edges lie to one side: a transfer curve other than the camera's does that, and so do
/// other causes. Nothing of paths without poses.
[[nodiscard]] std::optional<std::string> note_about_edges(const std::vector<BodyPath>& paths,
                                                          const data::Camera& camera);

/// Where a body goes on by whole frames at once, as it does where pictures are missing, or come
/// twice, that the times do not show: rarely, and told well. Nothing of a path with corners.
/// @param known  frames before which pictures are missing that the times allow for already.
[[nodiscard]] std::optional<std::string> note_about_steps(const data::Track& track,
                                                          const std::vector<std::int64_t>& known);

/// Where a body is somewhere else from one picture to the next, or after a few without it: farther
/// away than its radius, and than it could have gone. Its shadow begins so near.
/// @param radius_px  of the body.
[[nodiscard]] std::optional<std::string> note_about_cuts(const data::Track& track,
                                                         double radius_px);

/// Which frames were looked at for a body.
struct FramesRead {
  std::int64_t first = 0, last = 0;
  /// Up to there, if at all, the whole picture changed, and no background was known.
  std::optional<std::int64_t> moving_to{};
};

/// In which frames a body is not seen, and why as far as that shows: where that is a tenth of them
/// or more at one go.
/// @param path  with one frame at least.
[[nodiscard]] std::optional<std::string> note_about_lost(const BodyPath& path,
                                                         const FramesRead& read,
                                                         const VideoInfo& video);

/// How long the shutter was taken to be open, for want of better knowledge.
[[nodiscard]] std::string note_about_seen_exposure(double fraction, double frame_rate_hz);

/// Fraction 0..1 of the outline with an edge exactly there, in the median frame; 0 without frames.
[[nodiscard]] double usual_accepted(const BodyPath& path);

/// That something on the faces may have been taken for the outline.
/// @param seen usual_accepted of the body.  @param border where it begins, of the radius.
[[nodiscard]] std::string note_about_likely_border(double seen, double border);

/// The accepted edge points of all frames [px].
[[nodiscard]] data::Table edge_table(const std::vector<BodyPath>& paths);

}  // namespace trochoid::tracking
