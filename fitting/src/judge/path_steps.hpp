#pragma once
#include <vector>

#include "observe/observations.hpp"
#include "problem/problem.hpp"
#include "trochoid/data/fit.hpp"

namespace trochoid::fitting {

/// From a sample of an arc on its times are off.
struct TimeJump {
  int arc = 0, sample = 0;
  double frames = 0.0, sigma = 0.0;  ///< by how many of its usual steps too early
};

/// Whether that may be of pictures that were dropped, or written twice.
[[nodiscard]] bool is_whole(const TimeJump& jump);

/// The median step of an arc's times [s].
[[nodiscard]] double usual_step_s(const ArcData& arc);

/// Where a model does not explain a track: places where its path, a smooth curve before and after,
/// goes on by whole frames too far or too little. Such are told, as something to look at.
void tell_steps_of_path(const Problem& problem, data::Fit& fit);

}  // namespace trochoid::fitting
