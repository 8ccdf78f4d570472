#pragma once
#include <optional>
#include <vector>

#include "observe/observations.hpp"
#include "trochoid/data/camera.hpp"
#include "trochoid/data/scene.hpp"

namespace trochoid::fitting {

/// The camera that a scene's tracks were measured with, if it says how uncertain it is and its file
/// is still there.
[[nodiscard]] std::optional<data::Camera> uncertain_camera(const data::Scene& scene);

/// Notes in arcs what the camera's likely deviations shift their readings by, those that matter
/// beside the readings' own errors; in the same order in all arcs. What a camera changes of a
/// body's apparent size is left out of account.
/// @param scene  tells how high the centre is, with the tilt that was read.
void note_camera_shifts(const data::Camera& camera, const data::Scene& scene,
                        std::vector<ArcData>& arcs);

/// One of these shifts as the residuals see it, whitened; arc.rows long.
[[nodiscard]] Eigen::VectorXd whitened(const ArcData& arc, const CameraShifts& shifts);

}  // namespace trochoid::fitting
