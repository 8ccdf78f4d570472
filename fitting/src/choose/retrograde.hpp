#pragma once
#include <optional>

#include "trochoid/data/fit.hpp"
#include "trochoid/data/scene.hpp"

namespace trochoid::fitting {

/// When the mean path of a fitted rolling or sliding body begins to turn retrograde, in the track's
/// time [s]; nothing if it does not, or has no mean path: fewer than three turns, or a precession
/// that goes to and fro.
[[nodiscard]] std::optional<double> retrograde_from_s(const data::Fit& fit,
                                                      const data::Scene& scene);

}  // namespace trochoid::fitting
