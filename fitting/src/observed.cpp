#include "observed.hpp"

#include <limits>

namespace trochoid::fitting {
namespace {

using model::Observable;
using model::ParameterInfo;
using model::Prediction;
using model::PredictRequest;

class ObservedPredictor : public model::Predictor {
 public:
  ObservedPredictor(const model::Predictor& plain, bool scaled, bool timed)
      : plain_(plain), infos_(plain.parameters()), own_(static_cast<int>(infos_.size())) {
    const auto add = [&](const char* name, const char* meaning) {
      infos_.push_back({name, "1", ParameterInfo::Role::observation, 0.0,
                        std::numeric_limits<double>::infinity(), false, 1.0, true, meaning});
      return static_cast<int>(infos_.size()) - 1;
    };
    if (scaled) scale_ = add(kScale, "measured over true length");
    if (timed) factor_ = add(kTimeFactor, "true over measured duration");
  }
  [[nodiscard]] const std::string& model_name() const override { return plain_.model_name(); }
  [[nodiscard]] const std::vector<ParameterInfo>& parameters() const override { return infos_; }
  [[nodiscard]] Prediction predict(const Eigen::Ref<const Eigen::VectorXd>& values,
                                   const PredictRequest& request) const override;

 private:
  // The model's own prediction with durations stretched, without the scale.
  [[nodiscard]] Prediction stretched(const Eigen::Ref<const Eigen::VectorXd>& values,
                                     PredictRequest request, double factor) const {
    std::vector<double> t_s(request.t_s.begin(), request.t_s.end());
    for (double& t : t_s) t = request.start_s + factor * (t - request.start_s);
    request.t_s = t_s;
    return plain_.predict(values.head(own_), request);
  }
  void fill_factor(const Eigen::Ref<const Eigen::VectorXd>& values, PredictRequest request,
                   double factor, Eigen::Index column, Prediction& out) const;

  const model::Predictor& plain_;
  std::vector<ParameterInfo> infos_;
  int own_, scale_ = -1, factor_ = -1;
};

// By central differences: the path's own rate is not among a model's observables.
void ObservedPredictor::fill_factor(const Eigen::Ref<const Eigen::VectorXd>& values,
                                    PredictRequest request, double factor, Eigen::Index column,
                                    Prediction& out) const {
  constexpr double kStep = 1e-4;
  request.derivatives.clear();
  const Prediction later = stretched(values, request, factor * (1.0 + kStep));
  const Prediction earlier = stretched(values, request, factor * (1.0 - kStep));
  const double inverse = 0.5 / (kStep * factor);
  out.jacobian.col(column) = inverse * (later.values - earlier.values);
  if (request.want_end_state)
    out.end_state_jacobian.col(column) = inverse * (later.end_state - earlier.end_state);
}

Prediction ObservedPredictor::predict(const Eigen::Ref<const Eigen::VectorXd>& values,
                                      const PredictRequest& request) const {
  const double scale = scale_ >= 0 ? values[scale_] : 1.0;
  const double factor = factor_ >= 0 ? values[factor_] : 1.0;
  PredictRequest inner = request;
  std::erase_if(inner.derivatives, [&](int index) { return index >= own_; });
  const Prediction plain = stretched(values, inner, factor);
  Prediction out = plain;
  const auto width = static_cast<Eigen::Index>(request.derivatives.size());
  out.jacobian.setZero(plain.values.size(), width);
  if (request.want_end_state) out.end_state_jacobian.setZero(plain.end_state.size(), width);
  Eigen::Index from = 0;
  for (Eigen::Index c = 0; c < width; ++c) {
    const int index = request.derivatives[static_cast<std::size_t>(c)];
    if (index == factor_) fill_factor(values, inner, factor, c, out);
    if (index >= own_) continue;
    out.jacobian.col(c) = plain.jacobian.col(from);
    if (request.want_end_state) out.end_state_jacobian.col(c) = plain.end_state_jacobian.col(from);
    ++from;
  }
  const auto observables = static_cast<Eigen::Index>(request.observables.size());
  for (Eigen::Index row = 0; row < plain.values.size(); ++row) {
    const Observable what = request.observables[static_cast<std::size_t>(row % observables)];
    if (what != Observable::x_m && what != Observable::y_m) continue;
    out.values[row] *= scale;
    out.jacobian.row(row) *= scale;
    for (Eigen::Index c = 0; c < width; ++c)
      if (request.derivatives[static_cast<std::size_t>(c)] == scale_)
        out.jacobian(row, c) = plain.values[row];
  }
  return out;
}

}  // namespace

std::unique_ptr<model::Predictor> observed(const model::Predictor& predictor, data::Scene& scene) {
  auto& prior = scene.fit.prior;
  const bool from_radius = scene.camera.file.empty() && !scene.camera.scale_px_per_m;
  if (const auto radius = prior.find("radius_m");
      radius != prior.end() && from_radius && scene.body && !prior.contains(kScale))
    prior[kScale] = {scene.body->radius_m / radius->second.value,
                     scene.body->radius_m * radius->second.sigma /
                         (radius->second.value * radius->second.value)};
  if (const auto rate = prior.find("frame_rate_hz"); rate != prior.end()) {
    const double assumed_hz = scene.camera.frame_rate_hz.value_or(rate->second.value);
    prior[kTimeFactor] = {
        assumed_hz / rate->second.value,
        assumed_hz * rate->second.sigma / (rate->second.value * rate->second.value)};
  }
  const bool scaled = scene.fit.free_scale || prior.contains(kScale);
  const bool timed = prior.contains(kTimeFactor);
  if (!scaled && !timed) return nullptr;
  return std::make_unique<ObservedPredictor>(predictor, scaled, timed);
}

}  // namespace trochoid::fitting
