#pragma once
#include <memory>

#include "trochoid/data/scene.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::fitting {

inline constexpr const char* kScale = "scale";                   ///< measured over true length
inline constexpr const char* kTimeFactor = "frame_rate_factor";  ///< true over measured duration

/// Whether the known radius of the body gave the metres: there was no camera and no scale, or only
/// the camera that the body itself told.
[[nodiscard]] bool metres_by_radius(const data::Scene& scene);

/// Where it did and a prior says what that radius is, the prior on "scale" that follows, if there
/// is none yet: of the body's radius, by which the metres went, over the prior's.
void scale_by_radius(data::Scene& scene);

/// What the way of measuring adds to a model, as further parameters (role observation):
///   scale               x_measured = scale * x; with [fit] free_scale, a prior on "scale", or a
///                       prior on radius_m when the known radius gave the metres, with which
///                       the body that the model has is smaller by this scale (its radius: other
///                       dimensions were measured in true metres);
///   frame_rate_factor   t_true - t_start = factor * (t_measured - t_start); with a prior on
///                       frame_rate_hz (a clip whose container lies);
///   readout_s, angle_delay_s  see timing.hpp; with a prior on them or in [fit] free. Without a
///                       prior they are taken to lie within a frame's time of the scene's.
/// Writes their priors into scene.fit.prior.
/// @param frame_s  typical time between samples [s].
/// @returns null if the scene asks for none.
[[nodiscard]] std::unique_ptr<model::Predictor> observed(const model::Predictor& predictor,
                                                         data::Scene& scene, double frame_s);

}  // namespace trochoid::fitting
