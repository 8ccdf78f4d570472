#pragma once
#include <optional>
#include <string>

#include "study/high_precision.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/model/simulate.hpp"

namespace trochoid::tools {

/// One run of a scene against its reference.
struct StudyRun {
  model::Outcome outcome = model::Outcome::reached_end;
  std::string refusal;        ///< why the scene could not be run at all, empty if it was
  bool offered = true;        ///< the model has this integrator
  double axis_error = 0.0;    ///< largest |k - k_reference|, about the error of the tilt [rad]
  double path_error_m = 0.0;  ///< largest distance of the CoM from the reference
  double time_us = 0.0;       ///< fastest of the repeats, outputs included
  model::Statistics statistics;
  /// Largest change of the energy over its largest size, where the scene loses none and its mass is
  /// known.
  std::optional<double> energy_drift;
  double estimate_rad = 0.0;  ///< what the run itself says of its error in the axis
};

/// @param repeats  how often to run for the time.
[[nodiscard]] StudyRun study_run(const data::Scene& scene, const ReferenceRun& reference,
                                 int repeats);

}  // namespace trochoid::tools
