#pragma once
#include <optional>
#include <vector>

#include "judge/statistics.hpp"
#include "problem/problem.hpp"
#include "trochoid/data/fit.hpp"

namespace trochoid::fitting {

/// Profile likelihood of every free parameter but the initial angles and places: it is held at
/// values ever further from the solution and everything else fitted again, until chi-square has
/// risen by the 95 % quantile times its inflation (what readings have in common lets it rise too
/// fast), or the parameter has moved by four decades (a hundred standard deviations where it is not
/// logarithmic).
[[nodiscard]] std::vector<data::Profile> profiles(const Problem& problem, const Solution& solution,
                                                  const Uncertainty& error, int threads);

/// A parameter that chi-square lets go farther to one side than its error bar says.
struct FarSide {
  int index = 0;       ///< into Problem::free
  double sigma = 0.0;  ///< distance to the 95 % bound on that side over 1.96
};

/// The friction coefficient of a body that slides on its rim, where the data do not determine all
/// of its motion: the two replace each other along bent valleys, of which the curvature at the
/// solution knows one side at best. A coarse profile: a few points to either side, as a rule one.
[[nodiscard]] std::optional<FarSide> far_side_of_friction(const Problem& problem,
                                                          const Solution& solution,
                                                          const Uncertainty& error, int threads);

}  // namespace trochoid::fitting
