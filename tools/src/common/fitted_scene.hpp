#pragma once
#include <cstddef>
#include <string>

#include "trochoid/data/fit.hpp"
#include "trochoid/data/scene.hpp"

namespace trochoid::tools {

/// The scene a fit was made with as the fit took it: the model settled, and what [fit] prior says
/// in place of the body's and its surroundings' given values.
/// @param name  of the fit, for errors
[[nodiscard]] data::Scene scene_of(const data::Fit& fit, const std::string& name = "the fit");

/// scene_of() a fit, its [start] and coefficients replaced by the fitted values of one
/// arc, so that the motion can be simulated on its own: time 0 is where that arc begins. A top
/// whose mass or moment is unknown gets the moment 1 kg m^2 (the motion knows only a, b and l).
/// @param arc  place in Fit::arcs
/// @throws InputError if there is no such arc.
[[nodiscard]] data::Scene fitted_scene(const data::Fit& fit, std::size_t arc);

/// Whether a parameter is part of the state an arc starts from.
[[nodiscard]] bool is_start(const data::FitParameter& parameter);

/// True over measured duration, as fitted (a clip whose container lies); 1 where it was not.
[[nodiscard]] double time_factor(const data::Fit& fit);

/// Where the arc's initial state belongs, by the recording's clock [s].
[[nodiscard]] double arc_start_s(const data::Fit& fit, std::size_t arc);

}  // namespace trochoid::tools
