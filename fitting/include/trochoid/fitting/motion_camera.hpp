#pragma once
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "trochoid/data/camera.hpp"
#include "trochoid/data/fit.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/data/track.hpp"
#include "trochoid/fitting/fit.hpp"

namespace trochoid::fitting {

/// A camera corrected by what moves before it, and what it makes of the recordings.
struct MotionCamera {
  data::Camera camera;              ///< its covariance is what the motion leaves open
  std::vector<data::Track> tracks;  ///< as many and as long as those given
  /// Standard deviations of the state at the start, by name [the parameter's unit], with the camera
  /// and all usual losses free at once.
  std::map<std::string, double> sigmas;
};

/// Outlines tell a camera to a per cent; a motion whose law is known is thrown off by far less.
/// Takes up a fit once more with what is uncertain of the camera free as well, and measures the
/// same outlines by the camera that comes out, until that is the one they were measured by.
/// @param tracks  measured by the scene's camera, of a disc or ring on the floor.
/// @param fit     of these tracks: where to start. @param scene  of that fit, its model named.
/// @returns nothing where the motion is not explained with any such camera, or the scene's camera
///          file says nothing of what it leaves open.
/// @throws InputError, TrackError as fit() does.
[[nodiscard]] std::optional<MotionCamera> camera_by_motion(std::span<const data::Track> tracks,
                                                           const data::Fit& fit,
                                                           const data::Scene& scene,
                                                           const FitOptions& options = {});

/// A camera may have been bent by a loss that a fit of its tracks does without: widens the error
/// bars of that fit's state to what they are with the camera and all usual losses free at once.
void allow_for_camera(const MotionCamera& camera, data::Fit& fit);

}  // namespace trochoid::fitting
