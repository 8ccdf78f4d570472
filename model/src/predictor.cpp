#include "trochoid/model/predictor.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <string>

#include "factories.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::model {

int Predictor::index_of(const std::string& parameter) const {
  const auto& list = parameters();
  for (std::size_t i = 0; i < list.size(); ++i) {
    if (list[i].name == parameter) return static_cast<int>(i);
  }
  return -1;
}

void check_request(const Predictor& predictor, const Eigen::Ref<const Eigen::VectorXd>& values,
                   const PredictRequest& request) {
  const auto& list = predictor.parameters();
  if (values.size() != static_cast<Eigen::Index>(list.size())) {
    throw InputError(fmt::format("model {}: {} values for {} parameters", predictor.model_name(),
                                 values.size(), list.size()));
  }
  for (std::size_t i = 0; i < list.size(); ++i) {
    const double value = values[static_cast<Eigen::Index>(i)];
    if (!std::isfinite(value) || value < list[i].lower || value > list[i].upper) {
      throw InputError(fmt::format("model {}: {} = {} must lie between {} and {}",
                                   predictor.model_name(), list[i].name, value, list[i].lower,
                                   list[i].upper));
    }
  }
  double previous = request.start_s;
  for (const double t : request.t_s) {
    if (!(t >= previous)) {
      throw InputError(fmt::format("t_s = {} does not ascend from {}", t, previous));
    }
    previous = t;
  }
  for (const int index : request.derivatives) {
    if (index < 0 || index >= values.size())
      throw InputError(
          fmt::format("derivative by parameter {}: there are {}", index, values.size()));
    if (std::count(request.derivatives.begin(), request.derivatives.end(), index) > 1)
      throw InputError(fmt::format("derivative by parameter {} is asked for twice", index));
  }
}

std::vector<double> since_start_s(const PredictRequest& request) {
  std::vector<double> t_s;
  for (const double t : request.t_s) t_s.push_back(t - request.start_s);
  return t_s;
}

Prediction unknown_prediction(const PredictRequest& request) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const auto rows = static_cast<Eigen::Index>(request.t_s.size() * request.observables.size());
  Prediction out;
  out.values.setConstant(rows, kNan);
  out.jacobian.setConstant(rows, static_cast<Eigen::Index>(request.derivatives.size()), kNan);
  return out;
}

namespace {

constexpr const char* kSlopeNames[] = {"slope_x", "slope_y"};

bool speaks_of_slope(const data::FitSettings& fit) {
  return std::any_of(std::begin(kSlopeNames), std::end(kSlopeNames), [&](const char* name) {
    return fit.prior.contains(name) || fit.fixed.contains(name) || fit.bounds.contains(name) ||
           std::find(fit.free.begin(), fit.free.end(), name) != fit.free.end();
  });
}

}  // namespace

std::optional<Eigen::Vector2d> floor_slope(const data::Scene& scene) {
  const data::Support& support = scene.support;
  if (!support.slope_x && !support.slope_y && !speaks_of_slope(scene.fit)) return std::nullopt;
  const Eigen::Vector2d slope(support.slope_x.value_or(0.0), support.slope_y.value_or(0.0));
  for (int axis = 0; axis < 2; ++axis)
    if (!(std::abs(slope[axis]) <= data::Support::kSteepest))
      throw InputError(fmt::format(
          "support.{} = {} must lie between -{} and {}: a rise per length, of a floor nearly level",
          kSlopeNames[axis], slope[axis], data::Support::kSteepest, data::Support::kSteepest));
  return slope;
}

std::vector<ParameterInfo> slope_parameters(const Eigen::Vector2d& slope) {
  const auto along = [&](const char* name, double value, const char* meaning) {
    constexpr double kMost = data::Support::kSteepest;
    return ParameterInfo{name,  "1",    ParameterInfo::Role::dynamics, -kMost, kMost, false, value,
                         false, meaning};
  };
  return {along(kSlopeNames[0], slope.x(), "the floor's rise per length along x"),
          along(kSlopeNames[1], slope.y(), "the floor's rise per length along y")};
}

std::string law_of(const data::Scene& scene) {
  const data::ModelSettings& model = scene.model;
  if (model.name != "auto") return model.name;
  switch (scene.support.kind) {
    case data::SupportKind::none:
      return "free";
    case data::SupportKind::flat:
      return "puck";
    case data::SupportKind::pivot: {
      // A disc that lies on its pivot spins down; one that leans on it is a top.
      const bool leans = scene.start.theta_rad || (scene.body && scene.body->l_m);
      return scene.body && scene.body->kind != data::BodyKind::top && !leans ? "pivot" : "top";
    }
    case data::SupportKind::floor:
      break;
  }
  if (scene.body && scene.body->kind == data::BodyKind::top) return "top";
  return model.friction ? "sliding" : "rolling";
}

std::unique_ptr<Predictor> make_predictor(const data::Scene& scene) {
  check_rates(scene.start);
  const std::string name = law_of(scene);
  if (name == "top") return make_top(scene);
  if (name == "top-euler") return make_top_euler(scene);
  if (name == "rolling") return make_rolling(scene);
  if (name == "smooth") return make_smooth(scene);
  if (name == "sliding") return make_sliding(scene);
  if (name == "puck") return make_puck(scene);
  if (name == "pivot") return make_pivot(scene);
  throw InputError(
      fmt::format("model.name = \"{}\" cannot be predicted; models with a path are top, top-euler, "
                  "rolling, smooth, sliding, puck, pivot",
                  name));
}

}  // namespace trochoid::model
