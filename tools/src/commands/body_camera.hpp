#pragma once
#include <filesystem>
#include <string>

#include "trochoid/data/scene.hpp"
#include "trochoid/tracking/body_camera.hpp"

namespace trochoid::tools {

/// What `calibrate` needs for a camera told by the body itself.
struct BodyCameraCommand {
  std::filesystem::path video, scene, output;
  double camera_height_mm = 0.0;  ///< 0: not known
  bool json = false;
};

/// tracking::camera_from_body with progress on stderr. @param height_mm  as there, 0: not known.
[[nodiscard]] tracking::BodyCamera camera_by_body(const std::filesystem::path& video,
                                                  const data::Scene& scene, double height_mm = 0.0);

/// What a camera with a covariance sees of the floor in the middle of its pictures: "scale 1003 ±
/// 12 px/m on the floor, 1.16 m above it (0.835 to 1.61)".
[[nodiscard]] std::string overhead_words(const data::Camera& camera);

/// How a recording whose scene names no camera may come by one, or why it cannot; empty where the
/// scene says what the camera sees, or gives no body.
[[nodiscard]] std::string way_to_a_camera(const data::Scene& scene);

/// Finds the camera, writes it and tells about it.
/// @throws InputError, NumericalError: as tracking::camera_from_body.
void calibrate_by_body(const BodyCameraCommand& command);

}  // namespace trochoid::tools
