#pragma once
#include <string>
#include <vector>

#include "problem/problem.hpp"
#include "trochoid/data/fit.hpp"

namespace trochoid::fitting {

/// Which parameters only the tilt, the precession, the spin, or all of these angles together
/// determine: known to their natural size (natural_size) with these readings, and not by the rest
/// of the recording and the priors. The spin's own angle and the angles' delay, which nothing else
/// could show, do not count. Linear about the solution, and as if residuals were independent.
/// @param fit  says which parameters are determined at all; what it tells already is left out.
/// @param spin_follows  from the others and what is given of the body (derived.hpp).
/// @throws NumericalError where the model has no prediction.
[[nodiscard]] std::vector<data::BrokenDegeneracy> broken_degeneracies(const Problem& problem,
                                                                      const Eigen::VectorXd& u,
                                                                      const data::Fit& fit,
                                                                      bool spin_follows);

/// What is said of parameters that only these readings determine.
[[nodiscard]] data::BrokenDegeneracy broken_by(const std::string& readings,
                                               const std::vector<std::string>& names);

}  // namespace trochoid::fitting
