#pragma once
#include <optional>
#include <span>
#include <vector>

#include "trochoid/data/camera.hpp"
#include "trochoid/data/pose.hpp"
#include "trochoid/data/scene.hpp"

namespace trochoid::fitting {

/// Where another camera has a body of which it shows the same outline, less where the first has it.
struct OutlineShift {
  Eigen::Vector2d place_m = Eigen::Vector2d::Zero();
  double theta = 0.0, sine_phi = 0.0;  ///< precession times the sine of the tilt [rad]
};

/// To first order, by least squares over the outline, as a tracker does that holds the body to its
/// support: on the floor, flat on it, or with its axis through a pivot.
/// @param scene  has a body of known outline: a disc or ring, radius_m > 0.
/// @param pose   as `camera` has it. @param others  each nearly as `camera`.
/// @returns one for each of the others.
[[nodiscard]] std::vector<OutlineShift> outline_shifts(const data::Scene& scene,
                                                       const data::Pose<>& pose,
                                                       const data::Camera& camera,
                                                       std::span<const data::Camera> others);

/// Where another camera has that body, to all orders; nothing where no pose before it has that
/// outline, or any has.
[[nodiscard]] std::optional<data::Pose<>> seen_by(const data::Scene& scene,
                                                  const data::Pose<>& pose,
                                                  const data::Camera& camera,
                                                  const data::Camera& other);

}  // namespace trochoid::fitting
