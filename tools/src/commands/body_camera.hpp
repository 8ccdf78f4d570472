#pragma once
#include <filesystem>

namespace trochoid::tools {

/// What `calibrate` needs for a camera told by the body itself.
struct BodyCameraCommand {
  std::filesystem::path video, scene, output;
  double camera_height_mm = 0.0;  ///< 0: not known
  bool json = false;
};

/// Finds the camera, writes it and tells about it.
/// @throws InputError, NumericalError: as tracking::camera_from_body.
void calibrate_by_body(const BodyCameraCommand& command);

}  // namespace trochoid::tools
