#include "problem/free_parameter.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "observe/observed.hpp"
#include "observe/timing.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::fitting {

using model::ParameterInfo;

namespace {

bool listed(const std::vector<std::string>& names, const std::string& name) {
  return std::any_of(names.begin(), names.end(),
                     [&](const std::string& entry) { return means(entry, name); });
}

void check_names(const model::Predictor& predictor, const data::FitSettings& settings) {
  const auto known = [&](const std::string& name) {
    return std::any_of(predictor.parameters().begin(), predictor.parameters().end(),
                       [&](const ParameterInfo& info) { return means(name, info.name); });
  };
  const auto complain = [&](const std::string& key, const std::string& name) {
    std::string all;
    for (const ParameterInfo& info : predictor.parameters())
      all += (all.empty() ? "" : ", ") + info.name;
    throw InputError(
        fmt::format("[fit] {}: model '{}' has no parameter '{}'; it has {}, and those of losses "
                    "named under [model]",
                    key, predictor.model_name(), name, all));
  };
  for (const std::string& name : settings.free)
    if (!known(name)) complain("free", name);
  for (const auto& [name, value] : settings.fixed)
    if (!known(name)) complain("fixed", name);
  for (const auto& [name, bounds] : settings.bounds)
    if (!known(name)) complain("bounds", name);
}

// A value the model cannot have would be refused at every attempt of the search, and a prior about
// one would bend all the others. Attitudes are folded into their range.
void check_values(const model::Predictor& predictor, const data::FitSettings& settings) {
  constexpr double kSure = 3.0;  // standard deviations
  for (const ParameterInfo& info : predictor.parameters()) {
    const data::Prior* prior = said_of(info.name, settings.prior);
    const auto refuse_prior = [&](double lower, double upper, const char* whose) {
      if (prior != nullptr && !(prior->value + kSure * prior->sigma >= lower &&
                                prior->value - kSure * prior->sigma <= upper))
        throw InputError(fmt::format("[fit] prior: {} = {} ± {} lies outside {} {} .. {}",
                                     info.name, prior->value, prior->sigma, whose, lower, upper));
    };
    if (const auto* bounds = said_of(info.name, settings.bounds))
      refuse_prior(bounds->first, bounds->second, "its bounds");
    if (info.role == ParameterInfo::Role::initial) continue;
    refuse_prior(info.lower, info.upper, "what the model can have,");
    if (const double* value = said_of(info.name, settings.fixed);
        value != nullptr && !(*value >= info.lower && *value <= info.upper))
      throw InputError(fmt::format("[fit] fixed: {} = {} must lie between {} and {}", info.name,
                                   *value, info.lower, info.upper));
  }
}

// A thousandth of the bound's size or the parameter's: of a coefficient, known by its decades, what
// the scene gives; of a state, what such bodies have.
double inside_of(const ParameterInfo& info, double bound) {
  constexpr double kShare = 1e-3, kUsual_m = 0.1;
  double usual = info.unit == "rad" || info.unit == "rad/s" || info.unit == "1/s" ? 1.0 : kUsual_m;
  if (info.logarithmic) usual = std::numeric_limits<double>::min() / kShare;
  return kShare * std::max({std::abs(bound), std::abs(info.value), usual});
}

Transform transform_of(const ParameterInfo& info, const std::string& model,
                       const data::FitSettings& settings) {
  if (const auto* bounds = said_of(info.name, settings.bounds)) {
    const auto [lower, upper] = *bounds;
    const bool low = std::isfinite(lower), high = std::isfinite(upper);
    // What cannot be negative is no more so for a bound from above.
    const bool from_zero = info.logarithmic && !(lower > 0.0);
    if (high && from_zero && upper > 0.0) return {Transform::Kind::between, 0.0, upper};
    if (low && high) return {Transform::Kind::between, lower, upper};
    if (low && !from_zero) return {Transform::Kind::above, lower, upper, inside_of(info, lower)};
    if (high) return {Transform::Kind::below, lower, upper, inside_of(info, upper)};
  }
  // Beyond a coefficient of about 1.1 a disc on its rim has no consistent contact (Painleve).
  constexpr double kMostFriction = 1.1;
  if (info.name == "friction" && model == "sliding")
    return {Transform::Kind::limited, 0.0, std::max(kMostFriction, 1.5 * info.value)};
  if (is_slope(info.name)) return {Transform::Kind::between, info.lower, info.upper};
  if (info.name == "contact_radius_m") return {Transform::Kind::limited, 0.0, info.upper};
  if (info.name == kSlipScale) {
    const double sharpest_m_s = std::min(kSharpest_m_s, 0.5 * info.value);
    return {Transform::Kind::above, sharpest_m_s, 0.0, 1e-3 * sharpest_m_s};
  }
  return {info.logarithmic ? Transform::Kind::log : Transform::Kind::identity, 0.0, 0.0};
}

bool is_pivot(const std::string& name) {
  return name == "pivot_x_m" || name == "pivot_y_m";
}

}  // namespace

void check_settings(const model::Predictor& predictor, const data::FitSettings& settings) {
  check_names(predictor, settings);
  check_values(predictor, settings);
}

bool is_free(const ParameterInfo& info, const data::FitSettings& settings) {
  if (said_of(info.name, settings.fixed) != nullptr) return false;
  for (const char* asked_for : {kScale, kTimeFactor, kReadout, kAngleDelay})
    if (info.name == asked_for) return true;
  if (is_pivot(info.name) && settings.free_pivot) return true;
  // What is known to some error only is to be fitted.
  if (is_pivot(info.name))
    return listed(settings.free, info.name) || settings.prior.contains(info.name);
  if ((info.name == kSlipScale || is_slope(info.name)) && settings.prior.contains(info.name))
    return true;
  const bool chosen = !std::all_of(settings.free.begin(), settings.free.end(), leaves_choice);
  if (!chosen || info.role == ParameterInfo::Role::initial)
    return info.worth_fitting || listed(settings.free, info.name);
  return listed(settings.free, info.name);
}

bool tells_of_a_film(const data::Scene& scene) {
  const auto told = [](const auto& said) { return said.contains("gap_viscosity_Pa_s"); };
  return scene.model.gap_viscosity_Pa_s.value_or(0.0) >= kThickestAir_Pa_s ||
         told(scene.fit.fixed) || told(scene.fit.prior) || told(scene.fit.bounds);
}

bool means(const std::string& entry, const std::string& parameter) {
  return parameter == entry || (parameter.starts_with(entry) && parameter[entry.size()] == '[');
}

bool is_slope(const std::string& name) {
  return name == kSlopeX || name == kSlopeY;
}

bool leaves_choice(const std::string& name) {
  return is_pivot(name) || is_slope(name) || name == kReadout || name == kAngleDelay ||
         name == kSlipScale;
}

const data::Prior* prior_of(const std::string& parameter, int arc,
                            const data::FitSettings& settings) {
  if (arc >= 0)
    if (const auto own = settings.prior.find(fmt::format("{}@{}", parameter, arc));
        own != settings.prior.end())
      return &own->second;
  return said_of(parameter, settings.prior);
}

FreeParameter free_parameter(const model::Predictor& predictor, const data::FitSettings& settings,
                             int index, int arc, double value) {
  const ParameterInfo& info = predictor.parameters()[index];
  FreeParameter parameter{index, arc, transform_of(info, predictor.model_name(), settings), {}, {}};
  parameter.given = value;
  parameter.turns = info.name == "phi_rad" || info.name == "psi_rad";
  if (const auto* prior = prior_of(info.name, arc, settings)) parameter.prior = *prior;
  return parameter;
}

double off_prior(const data::Prior& prior, double value, bool turns) {
  const double off = value - prior.value;
  return (turns ? data::wrapped(off) : off) / prior.sigma;
}

}  // namespace trochoid::fitting
