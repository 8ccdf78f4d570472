#pragma once
#include <filesystem>
#include <functional>
#include <optional>

#include "trochoid/data/camera.hpp"
#include "trochoid/data/scene.hpp"

namespace trochoid::tracking {

/// How to look for a camera above a body.
struct BodyCameraOptions {
  std::optional<double> height_m;  ///< of the camera above the floor, as a tape measures it
  /// Called with the share 0..1 that is done; may be empty.
  std::function<void(double share)> progress{};
  /// As TrackOptions::checkpoint.
  std::function<void()> checkpoint{};
};

/// A camera that looks straight down on the floor, as a body of known size shows it.
struct BodyCamera {
  data::Camera camera;  ///< table origin below the middle of the picture; with its covariance
  double scale_px_per_m = 0.0, height_m = 0.0;   ///< as of Camera::overhead
  double sigma_scale = 0.0, sigma_height = 0.0;  ///< relative
  int pictures = 0;                              ///< whose outlines were used
  double rms_px = 0.0;                           ///< of their edges about the outlines
  /// Where a height was given: what the outlines tell of it on their own, its sigma relative, and
  /// how many sigmas of both the two are apart.
  double own_height_m = 0.0, sigma_own_height = 0.0, apart_sigmas = 0.0;
};

/// @throws InputError unless the scene's body has a size and lies on the floor or rolls on it.
void check_tells_a_camera(const data::Scene& scene);

/// Scale and height of a camera that looks straight down, for want of a board: those with which the
/// outline of the scene's body, in many poses, fits the pictures best. How large the body looks
/// tells the scale; how much larger where it is higher, and how much of its wall shows where it is
/// off the middle, tell the height. Taken for granted are a lens without distortion, its axis in
/// the middle of the picture, and that it looks straight down to about a degree; the covariance
/// allows for the latter.
/// @param scene  as check_tells_a_camera wants it; its camera's scale and height are not looked at.
/// @throws InputError as check_tells_a_camera and track_video do; NumericalError if the outlines do
/// not determine the camera.
[[nodiscard]] BodyCamera camera_from_body(const std::filesystem::path& video,
                                          const data::Scene& scene,
                                          const BodyCameraOptions& options = {});

}  // namespace trochoid::tracking
