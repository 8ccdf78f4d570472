#pragma once
#include <optional>

#include "judge/statistics.hpp"
#include "problem/problem.hpp"

namespace trochoid::fitting {

/// How large the l of a top may be. The path of small tilts is l sin(theta) times an oscillation
/// that a and b determine; only by what it differs from a harmonic one, about theta^2 of it, it
/// tells l. Towards small l chi-square rises like a cliff, towards large ones it may stay level.
struct UprightTop {
  int length = 0;                  ///< l among Problem::free
  std::optional<double> most_m;    ///< 95 % bound from above; empty: nothing limits it
  double least_m = 0.0;            ///< 95 % bound from below where nothing limits it from above
  Eigen::VectorXd far;             ///< u at the largest l looked at
  std::optional<Solution> better;  ///< at a larger l; the rest is then of no use
};

/// Empty where l is not among the free parameters of a top's model or the curvature tells it to
/// some per cent.
[[nodiscard]] std::optional<UprightTop> upright_top(const Problem& problem,
                                                    const Solution& solution,
                                                    const Uncertainty& error);

}  // namespace trochoid::fitting
