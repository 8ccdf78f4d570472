#pragma once
#include <optional>

#include "trochoid/data/fit.hpp"
#include "trochoid/data/scene.hpp"

namespace trochoid::fitting {

/// When the mean path of a fitted rolling or sliding body begins to turn retrograde, in the track's
/// time [s]; nothing if it does not, or is too short for a mean path.
[[nodiscard]] std::optional<double> retrograde_from_s(const data::Fit& fit,
                                                      const data::Scene& scene);

}  // namespace trochoid::fitting
