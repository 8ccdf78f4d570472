#pragma once
#include <vector>

#include "judge/statistics.hpp"
#include "problem/problem.hpp"
#include "trochoid/data/fit.hpp"

// Recorders drop pictures, or write one twice, and may number and time the others as if they had
// not: the body is then ahead of its times, or behind, by whole frames.
namespace trochoid::fitting {

/// What puts a track's times right.
struct LostPictures {
  struct TimeStep {
    int arc = 0;
    double t_s = 0.0;  ///< of the first sample that is off
    int frames = 0;    ///< by how many of the arc's usual steps too early; negative: too late
  };
  std::vector<TimeStep> steps;  ///< in the order of arcs and times
  double noise_scale = 1.0;     ///< residuals of positions then, in their stated sigmas
};

/// Looks for steps in time that the residuals of positions speak for: where chi-square would fall
/// most by the derivatives, all parameters following; adds whole frames there and goes downhill.
/// Nothing unless that leaves no further step, and residuals that are clearly less.
/// @param u  a minimum, by which the problem's weights are set.
/// @throws NumericalError where the model has no prediction.
[[nodiscard]] LostPictures lost_pictures(const Problem& problem, const Eigen::VectorXd& u);

/// A fit that explains its track but for those is doubtful, of another they are told.
void doubt_if_pictures_are_lost(const Problem& problem, const Eigen::VectorXd& u,
                                const Uncertainty& error, data::Fit& fit);

}  // namespace trochoid::fitting
