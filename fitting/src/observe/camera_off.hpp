#pragma once
#include <Eigen/Core>
#include <memory>
#include <string>

#include "trochoid/data/scene.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::fitting {

inline constexpr const char* kDeviations = "sd";  ///< the unit of these parameters

/// Whether a parameter is by how many of its likely deviations the camera is off, "camera_off[1]".
[[nodiscard]] bool is_camera_off(const std::string& parameter);

/// The index of the first of these parameters, which the others follow; -1: there is none.
[[nodiscard]] int first_camera_off(const model::Predictor& predictor);

/// A predictor with that as further parameters (role observation), one for each likely deviation of
/// the camera; what they do to a prediction is worked out where the samples are known
/// (problem.hpp). Writes their priors into scene.fit.prior.
/// @param predictor  is kept and has to outlive the result.
/// @param likely     where they most likely are, each with a standard deviation of 1.
[[nodiscard]] std::unique_ptr<model::Predictor> with_camera_off(const model::Predictor& predictor,
                                                                const Eigen::VectorXd& likely,
                                                                data::Scene& scene);

}  // namespace trochoid::fitting
