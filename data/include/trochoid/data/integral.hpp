#pragma once
#include <Eigen/Core>
#include <span>

namespace trochoid::data {

/// Integral of f over t from the first time to each, by the trapezoidal rule: 0 at the first.
/// @param t  as many as values of f, at least one.
[[nodiscard]] Eigen::VectorXd running_integral(std::span<const double> t,
                                               const Eigen::Ref<const Eigen::VectorXd>& f);

}  // namespace trochoid::data
