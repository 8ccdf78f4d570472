#include "observe/observed.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>
#include <utility>

#include "observe/timing.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/fitting/fit.hpp"

namespace trochoid::fitting {
namespace {

using model::Observable;
using model::ParameterInfo;
using model::Prediction;
using model::PredictRequest;

// A known radius by which the metres went: where they are wrong, the body is as much smaller or
// larger than the model has it.
struct MetresByRadius {
  data::Scene scene;         // of the model
  double measured_m = 0.0;   // the radius times the scale
  double usual_scale = 1.0;  // that of the model's own body
};

// The body as large as it is by this scale.
data::Scene resized(const MetresByRadius& metres, double scale) {
  data::Scene scene = metres.scene;
  data::Body& body = *scene.body;
  body.radius_m = metres.measured_m / scale;
  body.inner_radius_m = std::min(body.inner_radius_m, body.radius_m);
  return scene;
}

// One for each row that is a position, else nothing.
Eigen::VectorXd are_positions(const PredictRequest& request, Eigen::Index rows) {
  Eigen::VectorXd are = Eigen::VectorXd::Zero(rows);
  const std::size_t observables = request.observables.size();
  for (Eigen::Index row = 0; row < rows; ++row) {
    const Observable what = request.observables[static_cast<std::size_t>(row) % observables];
    if (what == Observable::x_m || what == Observable::y_m) are[row] = 1.0;
  }
  return are;
}

// By central differences; from one side where the other has no prediction any more.
Eigen::VectorXd derivative(const Eigen::VectorXd& here, const Eigen::VectorXd& later,
                           const Eigen::VectorXd& earlier, double step) {
  Eigen::VectorXd out = 0.5 / step * (later - earlier);
  for (Eigen::Index i = 0; i < out.size(); ++i) {
    if (std::isfinite(out[i]) || !std::isfinite(here[i])) continue;
    const double ahead = later[i] - here[i], back = here[i] - earlier[i];
    out[i] = std::isfinite(ahead) ? ahead / step : std::isfinite(back) ? back / step : 0.0;
  }
  return out;
}

class ObservedPredictor : public model::Predictor {
 public:
  struct Asked {
    bool scale = false, factor = false, readout = false, delay = false;
    [[nodiscard]] bool any() const { return scale || factor || readout || delay; }
  };
  ObservedPredictor(const model::Predictor& plain, const Asked& asked, double readout_s,
                    std::optional<MetresByRadius> by_radius)
      : plain_(plain), infos_(plain.parameters()), by_radius_(std::move(by_radius)) {
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
  // Of a body as large as the metres are by this scale; null: as the model has it.
  [[nodiscard]] std::unique_ptr<model::Predictor> resized(double scale) const;
  // What the model itself has no derivative by.
  void fill(const Eigen::Ref<const Eigen::VectorXd>& values, const PredictRequest& request,
            Eigen::Index column, Prediction& out) const;

  const model::Predictor& plain_;
  std::vector<ParameterInfo> infos_;
  int scale_ = -1, factor_ = -1;
  std::optional<MetresByRadius> by_radius_;
};

std::unique_ptr<model::Predictor> ObservedPredictor::resized(double scale) const {
  if (!by_radius_ || scale == by_radius_->usual_scale) return nullptr;
  return model::make_predictor(trochoid::fitting::resized(*by_radius_, scale));
}

void ObservedPredictor::fill(const Eigen::Ref<const Eigen::VectorXd>& values,
                             const PredictRequest& request, Eigen::Index column,
                             Prediction& out) const {
  constexpr double kStep = 1e-4;
  const int index = request.derivatives[static_cast<std::size_t>(column)];
  // So fine that the two runs do not differ by their integration errors.
  constexpr double kFine = 1e-10;
  PredictRequest without = request;
  without.derivatives.clear();
  without.tolerance = std::min(request.tolerance, kFine);
  Eigen::VectorXd moved = values;
  const auto at = [&](double share) {
    moved[index] = values[index] * (1.0 + share);
    try {
      return predict(moved, without);
    } catch (const InputError&) {  // no such body
      constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
      Prediction none;
      none.values.setConstant(out.values.size(), kNone);
      none.end_state.setConstant(out.end_state.size(), kNone);
      return none;
    }
  };
  const Prediction later = at(kStep), earlier = at(-kStep);
  const double step = kStep * values[index];
  out.jacobian.col(column) = derivative(out.values, later.values, earlier.values, step);
  if (request.want_end_state)
    out.end_state_jacobian.col(column) =
        derivative(out.end_state, later.end_state, earlier.end_state, step);
}

Prediction ObservedPredictor::predict(const Eigen::Ref<const Eigen::VectorXd>& values,
                                      const PredictRequest& request) const {
  const double scale = scale_ >= 0 ? values[scale_] : 1.0;
  const double factor = factor_ >= 0 ? values[factor_] : 1.0;
  const auto other = resized(scale);
  const model::Predictor& model = other ? *other : plain_;
  const auto own = static_cast<int>(model.parameters().size());
  PredictRequest inner = request;
  std::vector<double> t_s(request.t_s.begin(), request.t_s.end());
  for (double& t : t_s) t = request.start_s + factor * (t - request.start_s);
  inner.t_s = t_s;
  std::erase_if(inner.derivatives, [&](int index) { return index >= own; });
  Prediction plain = model.predict(values.head(own), inner);
  Prediction out = plain;
  const auto width = static_cast<Eigen::Index>(request.derivatives.size());
  out.jacobian.setZero(plain.values.size(), width);
  if (request.want_end_state) out.end_state_jacobian.setZero(plain.end_state.size(), width);
  Eigen::Index from = 0;
  for (Eigen::Index c = 0; c < width; ++c) {
    if (request.derivatives[static_cast<std::size_t>(c)] >= own) continue;
    out.jacobian.col(c) = plain.jacobian.col(from);
    if (request.want_end_state) out.end_state_jacobian.col(c) = plain.end_state_jacobian.col(from);
    ++from;
  }
  const Eigen::VectorXd positions = are_positions(request, out.values.size());
  const Eigen::VectorXd by = (1.0 + (scale - 1.0) * positions.array()).matrix();
  out.values.array() *= by.array();
  out.jacobian.array().colwise() *= by.array();
  for (Eigen::Index c = 0; c < width; ++c) {
    const int index = request.derivatives[static_cast<std::size_t>(c)];
    if (index == factor_ || (index == scale_ && by_radius_))
      fill(values, request, c, out);
    else if (index == scale_)
      out.jacobian.col(c) = positions.array() * plain.values.array();
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

std::optional<MetresByRadius> metres_of(const data::Scene& scene) {
  const auto radius = scene.fit.prior.find("radius_m"), scale = scene.fit.prior.find(kScale);
  if (radius == scene.fit.prior.end() || scale == scene.fit.prior.end() || !scene.body ||
      !metres_by_radius(scene))
    return std::nullopt;
  return MetresByRadius{scene, radius->second.value * scale->second.value, scale->second.value};
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

void resize(data::Scene& scene, double scale) {
  if (const auto metres = metres_of(scene)) scene = resized(*metres, scale);
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
  std::optional<MetresByRadius> metres = metres_of(scene);
  if (metres) metres->scene.model.name = predictor.model_name();
  return std::make_unique<ObservedPredictor>(predictor, asked, scene.camera.readout_s,
                                             std::move(metres));
}

}  // namespace trochoid::fitting
