#include "choose/retrograde.hpp"

#include <algorithm>
#include <cmath>

#include "trochoid/data/error.hpp"
#include "trochoid/fitting/fit.hpp"
#include "trochoid/model/mean_path.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::fitting {

std::optional<double> retrograde_from_s(const data::Fit& fit, const data::Scene& scene) {
  const bool rim = fit.model == "rolling" || fit.model == "sliding";
  if (!rim || !fit.converged || fit.arcs.size() != 1) return std::nullopt;
  const double from_s = fit.arcs[0].from_s, duration_s = fit.arcs[0].to_s - from_s;
  constexpr double kRate_Hz = 1000.0;  // tens of rows to a turn
  const int rows = std::clamp(static_cast<int>(kRate_Hz * duration_s), 200, 30000);
  std::vector<double> t_s;
  for (int i = 0; i < rows; ++i) t_s.push_back(from_s + duration_s * i / (rows - 1));
  model::PredictRequest request;
  request.t_s = t_s;
  request.start_s = from_s;
  request.observables.push_back(model::Observable::phi_rad);
  const Eigen::VectorXd run = fitted_prediction(fit, scene, 0, request).values;
  Eigen::Index good = 0;
  while (good < rows && run.segment<3>(3 * good).allFinite()) ++good;
  const Eigen::Map<const Eigen::Matrix<double, 3, Eigen::Dynamic>> path(run.data(), 3, good);
  const Eigen::Map<const Eigen::VectorXd> times(t_s.data(), good);
  try {
    const auto mean = model::mean_path(times, path.row(2).transpose(), path.row(0).transpose(),
                                       path.row(1).transpose());
    return mean.inflection_s();
  } catch (const InputError&) {  // too few turns, or precession to and fro: no mean path
    return std::nullopt;
  }
}

}  // namespace trochoid::fitting
