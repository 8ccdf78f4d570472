#include "observe/observed.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <filesystem>
#include <limits>

#include "observe/timing.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::fitting {
namespace {

using model::Observable;
using model::ParameterInfo;
using model::Prediction;
using model::PredictRequest;

class ObservedPredictor : public model::Predictor {
 public:
  struct Asked {
    bool scale = false, factor = false, readout = false, delay = false;
    [[nodiscard]] bool any() const { return scale || factor || readout || delay; }
  };
  ObservedPredictor(const model::Predictor& plain, const Asked& asked, double readout_s)
      : plain_(plain), infos_(plain.parameters()), own_(static_cast<int>(infos_.size())) {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    const auto add = [&](const char* name, const char* unit, double value, const char* meaning) {
      infos_.push_back({name, unit, ParameterInfo::Role::observation,
                        unit[0] == 's' ? -kInfinity : 0.0, kInfinity, false, value, true, meaning});
      return static_cast<int>(infos_.size()) - 1;
    };
    if (asked.scale) scale_ = add(kScale, "1", 1.0, "measured over true length");
    if (asked.factor) factor_ = add(kTimeFactor, "1", 1.0, "true over measured duration");
    // Applied where the samples' rows are known (timing.hpp).
    if (asked.readout) add(kReadout, "s", readout_s, "rolling shutter, first to last row");
    if (asked.delay) add(kAngleDelay, "s", 0.0, "angles later than positions");
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

namespace {

// What a scale or a rate is reckoned from.
const data::Prior& positive(const std::string& name, const data::Prior& prior) {
  if (!(prior.value > 0.0))
    throw InputError(fmt::format("[fit] prior: {} = {} must be greater than 0", name, prior.value));
  return prior;
}

}  // namespace

bool metres_by_radius(const data::Scene& scene) {
  const std::string& file = scene.camera.file;
  if (scene.camera.scale_px_per_m) return false;
  if (file.empty()) return true;
  std::error_code ignored;  // a camera file may have gone since
  return std::filesystem::is_regular_file(file, ignored) &&
         data::read_camera(file).metres_by_radius;
}

void scale_by_radius(data::Scene& scene) {
  auto& prior = scene.fit.prior;
  const auto radius = prior.find("radius_m");
  if (radius == prior.end() || !scene.body || prior.contains(kScale) || !metres_by_radius(scene))
    return;
  const auto [value_m, sigma_m] = positive(radius->first, radius->second);
  prior[kScale] = {scene.body->radius_m / value_m,
                   scene.body->radius_m * sigma_m / (value_m * value_m)};
}

std::unique_ptr<model::Predictor> observed(const model::Predictor& predictor, data::Scene& scene,
                                           double frame_s) {
  scale_by_radius(scene);
  auto& prior = scene.fit.prior;
  if (const auto rate = prior.find("frame_rate_hz"); rate != prior.end()) {
    const auto [value_hz, sigma_hz] = positive(rate->first, rate->second);
    const double assumed_hz = scene.camera.frame_rate_hz.value_or(value_hz);
    prior[kTimeFactor] = {assumed_hz / value_hz, assumed_hz * sigma_hz / (value_hz * value_hz)};
  }
  const auto asked_for = [&](const char* name, double usual) {
    const auto& free = scene.fit.free;
    const bool listed = std::find(free.begin(), free.end(), name) != free.end();
    if (listed && !prior.contains(name)) prior[name] = {usual, frame_s};
    return prior.contains(name);
  };
  const ObservedPredictor::Asked asked{
      scene.fit.free_scale || prior.contains(kScale), prior.contains(kTimeFactor),
      asked_for(kReadout, scene.camera.readout_s), asked_for(kAngleDelay, 0.0)};
  if (!asked.any()) return nullptr;
  return std::make_unique<ObservedPredictor>(predictor, asked, scene.camera.readout_s);
}

}  // namespace trochoid::fitting
