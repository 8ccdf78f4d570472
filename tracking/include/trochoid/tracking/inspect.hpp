#pragma once
#include <filesystem>
#include <optional>

#include "trochoid/tracking/frame_source.hpp"

namespace trochoid::tracking {

/// What a first look at a recording tells, before anything is known about it.
struct Inspection {
  struct Body {
    double radius_px = 0.0;         ///< largest extent of its rim, halved
    double least_axis_ratio = 1.0;  ///< of the rim's ellipse: the steepest tilt seen
    double usual_axis_ratio = 1.0;  ///< its median
    double travel_px = 0.0;         ///< diagonal of the box its centre stayed in
    bool bore_shows = false;        ///< the floor is seen through its middle: a ring
    int frames = 0;                 ///< in which it was followed
  };
  VideoInfo video;
  double restless = 0.0;     ///< share of the picture that changes most of the time
  std::optional<Body> body;  ///< the body that moves most plainly, if any
};

/// Looks at a recording until a moving body was seen: mostly its first part, what fits in memory.
/// @param frame_rate_hz overrides the time stamps; an image sequence has none.
/// @throws InputError as open_video does.
[[nodiscard]] Inspection inspect_video(const std::filesystem::path& path,
                                       std::optional<double> frame_rate_hz = {});

}  // namespace trochoid::tracking
