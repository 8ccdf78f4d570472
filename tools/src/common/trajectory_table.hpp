#pragma once
#include "trochoid/data/table.hpp"
#include "trochoid/model/simulate.hpp"

namespace trochoid::tools {

/// A run as the trajectory file holds it: its columns, and in the header model, integrator and why
/// it was taken, outcome, error estimate, steps and events.
[[nodiscard]] data::Table trajectory_table(const model::Trajectory& run);

}  // namespace trochoid::tools
