#pragma once
#include <optional>
#include <vector>

#include "observe/observations.hpp"
#include "trochoid/data/camera.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/data/track.hpp"

namespace trochoid::fitting {

/// The camera that a scene's tracks were measured with, if it says how uncertain it is and its file
/// is still there.
[[nodiscard]] std::optional<data::Camera> uncertain_camera(const data::Scene& scene);

/// Notes in arcs what the camera's likely deviations shift their readings by, in the same order in
/// all arcs.
/// @param scene  tells how high the centre is, with the tilt that was read.
/// @param all    also those that do not matter beside the readings' own errors.
void note_camera_shifts(const data::Camera& camera, const data::Scene& scene, bool all,
                        std::vector<ArcData>& arcs);

/// What another camera makes of the picture in which one measured a sample of a body on the floor.
[[nodiscard]] data::TrackSample measured_by(const data::Scene& scene, data::TrackSample sample,
                                            const data::Camera& camera, const data::Camera& other);

/// One of these shifts as the residuals see it, whitened; arc.rows long.
[[nodiscard]] Eigen::VectorXd whitened(const ArcData& arc, const CameraShifts& shifts);

}  // namespace trochoid::fitting
