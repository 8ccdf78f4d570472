#pragma once
#include <cmath>
#include <span>
#include <string>

#include "trochoid/data/fit.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/fitting/fit.hpp"

namespace trochoid::fitting {

/// A top about the origin that loses nothing.
inline data::Scene top() {
  data::Scene scene;
  scene.support.kind = data::SupportKind::pivot;
  scene.support.pivot_m = Eigen::Vector3d::Zero();
  scene.model.name = "top";
  return scene;
}

inline data::Fit fit_of(const data::Track& track, const data::Scene& scene) {
  return fit(std::span(&track, 1), scene);
}

/// Deviation of a parameter from the truth in the fit's own sigmas; infinite where it has none.
inline double pull(const data::Fit& fit, const std::string& name, double truth) {
  const data::FitParameter* parameter = fit.find(name);
  if (parameter == nullptr) return INFINITY;
  return std::abs(parameter->value - truth) / parameter->sigma;
}

/// 4 sigma of a few numbers: once in some thousand seeds.
inline constexpr double kFar = 4.0;

}  // namespace trochoid::fitting
