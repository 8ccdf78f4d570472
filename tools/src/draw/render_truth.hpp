#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "trochoid/data/camera.hpp"
#include "trochoid/data/pose.hpp"
#include "trochoid/data/scene.hpp"

namespace trochoid::tools {

/// What is true of a made recording, in the files that `study tracking` reads: truth.csv's header
/// and rows, and object.json.
inline constexpr const char* kTruthHeader =
    "frame,t,x_m,y_m,z_m,x_px,y_px,qw,qx,qy,qz,theta_rad,phi_rad,psi_rad,vis_frac\n";

/// The body's pose in a frame, t_s being when the row of its centre was read.
[[nodiscard]] std::string truth_row(int frame, double t_s, const data::Pose<>& pose,
                                    const data::Camera& camera);

/// Whether the body's centre is within the picture.
[[nodiscard]] bool in_picture(const data::Pose<>& pose, const data::Camera& camera);

/// The scene's body and what it moves by.
[[nodiscard]] nlohmann::ordered_json object_of(const data::Scene& scene, const std::string& model);

}  // namespace trochoid::tools
