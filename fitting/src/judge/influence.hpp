#pragma once
#include <Eigen/Core>
#include <vector>

#include "problem/problem.hpp"

namespace trochoid::fitting {

/// A sample on which a solution hangs.
struct InfluentialSample {
  double t_s = 0.0;
  Eigen::VectorXd shift;  ///< of the values, when the sample is left out
};

/// Robust weights tell what stands out of the path, but the path goes through a sample that alone
/// says something: how a body slid before the second picture hangs on where it was in the first
/// two, and a long bent valley leads from there to not sliding at all. Leaves out in turn the few
/// samples that carry most of a direction of the parameters, goes downhill from there, and returns
/// those without which a parameter comes to lie many of its error bars away.
/// @param sigmas  the error bars of the values.
[[nodiscard]] std::vector<InfluentialSample> influential_samples(const Problem& problem,
                                                                 const Solution& solution,
                                                                 const Eigen::VectorXd& sigmas);

}  // namespace trochoid::fitting
