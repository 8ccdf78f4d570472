#pragma once
#include "trochoid/data/scene.hpp"
#include "trochoid/data/table.hpp"

namespace trochoid::tools {

/// Appends what the thesis plots beside the state: angular velocity and angular momentum in body
/// axes, Euler angles wrapped to (-pi, pi], the running integrals of the body rates (which are not
/// angles, docs/thesis.md), and its own coordinates (X, Y) = (-y, x).
/// @param table a trajectory with t_s, the Euler angles and their rates.
void add_thesis_quantities(const data::Scene& scene, data::Table& table);

}  // namespace trochoid::tools
