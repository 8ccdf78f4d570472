#include "judge/first_guess.hpp"
#include "observe/observed.hpp"
#include "observe/timing.hpp"
#include "trochoid/fitting/fit.hpp"

// A fit taken up again: the motion it found.
namespace trochoid::fitting {

data::Scene scene_as_fitted(const data::Scene& given) {
  return completed(given, {});
}

namespace {

const data::FitParameter* found_for(const data::Fit& fit, const model::ParameterInfo& info,
                                    std::size_t arc) {
  return info.role == model::ParameterInfo::Role::initial ? fit.find_state(info.name, arc)
                                                          : fit.find(info.name, arc);
}

}  // namespace

Eigen::VectorXd fitted_values(const model::Predictor& predictor, const data::Fit& fit,
                              std::size_t arc) {
  const auto& parameters = predictor.parameters();
  Eigen::VectorXd values(static_cast<Eigen::Index>(parameters.size()));
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const data::FitParameter* fitted = found_for(fit, parameters[i], arc);
    // A puck whose spin nothing showed was taken not to turn, whatever its scene has.
    const bool unseen_spin = fit.model == "puck" && parameters[i].name == "w3_rad_s";
    const double otherwise = unseen_spin ? 0.0 : parameters[i].value;
    values[static_cast<Eigen::Index>(i)] = fitted != nullptr ? fitted->value : otherwise;
  }
  return values;
}

model::Prediction fitted_prediction(const data::Fit& fit, const data::Scene& given, std::size_t arc,
                                    const model::PredictRequest& request,
                                    const std::vector<double>& row_px) {
  data::Scene scene = scene_as_fitted(given);
  const auto plain = model::make_predictor(scene);
  const auto seen = observed(*plain, scene, 0.0);
  const model::Predictor& predictor = seen ? *seen : *plain;
  const Eigen::VectorXd values = fitted_values(predictor, fit, arc);
  if (!has_timing(predictor)) return predictor.predict(values, request);
  ArcData samples;
  samples.t_s.assign(request.t_s.begin(), request.t_s.end());
  samples.row_px = row_px;
  return predict_timed(predictor, values, request, samples, timing_of(predictor, scene));
}

}  // namespace trochoid::fitting
