#pragma once
#include "problem.hpp"
#include "trochoid/data/fit.hpp"

namespace trochoid::fitting {

/// Squares of the positions, in units of the track's sigmas: about the prediction, about their
/// mean, and about a smooth curve.
struct Squares {
  bool ok = true;
  double residual = 0.0, motion = 0.0, scatter = 0.0;
};
[[nodiscard]] Squares squares(const Problem& problem, const Solution& solution);

/// False for a quiet minimiser in the wrong valley: the residuals carry a good part of the motion
/// although the samples scatter far less about a smooth curve.
[[nodiscard]] bool explains_path(const Squares& sum);

void warn_unexplained(const Squares& sum, data::Fit& fit);

}  // namespace trochoid::fitting
