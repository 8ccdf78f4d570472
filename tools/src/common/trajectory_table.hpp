#pragma once
#include "trochoid/data/table.hpp"
#include "trochoid/model/simulate.hpp"

namespace trochoid::tools {

/// A run's estimate of its own error: "1.2e-11 m, 3.4e-10 rad", without metres where its centre of
/// mass stays where it is.
[[nodiscard]] std::string error_words(const model::Trajectory& run);

/// A run as the trajectory file holds it: its columns, and in the header model, integrator and why
/// it was taken, outcome, error estimate, steps and events.
[[nodiscard]] data::Table trajectory_table(const model::Trajectory& run);

}  // namespace trochoid::tools
