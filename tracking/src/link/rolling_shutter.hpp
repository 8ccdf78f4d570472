#pragma once
#include "link/track_assembly.hpp"
#include "trochoid/data/body.hpp"
#include "trochoid/data/camera.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/tracking/frame_source.hpp"

namespace trochoid::tracking {

/// A recording whose rows are read one after the other, through one camera.
struct RollingShutter {
  double readout_s = 0.0;  ///< from the first row to the last
  VideoInfo video{};       ///< whose rows these are
  data::Camera camera{};
};

/// Puts every pose of a path where the body was when the row of its centre was read. Rows above and
/// below showed it earlier and later, and one who takes them all for the same moment sees another
/// tilt, another direction of it, and a mark that has turned by less or more. To first order in the
/// motion, which the frames on both sides tell; where these do not show the body, poses stay.
void undo_rolling_shutter(const RollingShutter& shutter, const data::Body& body,
                          const data::Support& support, BodyPath& path);

}  // namespace trochoid::tracking
