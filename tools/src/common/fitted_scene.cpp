#include "common/fitted_scene.hpp"

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <optional>

#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/fitting/fit.hpp"

namespace trochoid::tools {
namespace {

using data::ModelSettings;
using data::StartSettings;

const std::map<std::string, std::optional<double> StartSettings::*> kStart{
    {"theta_rad", &StartSettings::theta_rad},
    {"phi_rad", &StartSettings::phi_rad},
    {"psi_rad", &StartSettings::psi_rad},
    {"w1_rad_s", &StartSettings::w1_rad_s},
    {"w2_rad_s", &StartSettings::w2_rad_s},
    {"w3_rad_s", &StartSettings::w3_rad_s},
    {"dtheta_rad_s", &StartSettings::dtheta_rad_s},
    {"dphi_rad_s", &StartSettings::dphi_rad_s},
    {"dpsi_rad_s", &StartSettings::dpsi_rad_s},
    {"x_m", &StartSettings::x_m},
    {"y_m", &StartSettings::y_m},
    {"vx_m_s", &StartSettings::vx_m_s},
    {"vy_m_s", &StartSettings::vy_m_s}};

const std::map<std::string, std::optional<double> ModelSettings::*> kCoefficients{
    {"air_force_N_s_m", &ModelSettings::air_force_N_s_m},
    {"gap_viscosity_Pa_s", &ModelSettings::gap_viscosity_Pa_s},
    {"friction", &ModelSettings::friction},
    {"slip_regularisation_m_s", &ModelSettings::slip_regularisation_m_s},
    {"contact_radius_m", &ModelSettings::contact_radius_m},
    {"rolling_friction_m", &ModelSettings::rolling_friction_m},
    {"pivoting_friction_m", &ModelSettings::pivoting_friction_m},
    {"contour_friction_m", &ModelSettings::contour_friction_m},
    {"spin_down_dry_rad_s2", &ModelSettings::spin_down_dry_rad_s2},
    {"spin_down_weakening_s_rad", &ModelSettings::spin_down_weakening_s_rad},
    {"spin_down_viscous_1_s", &ModelSettings::spin_down_viscous_1_s},
    {"spin_down_quadratic_1_rad", &ModelSettings::spin_down_quadratic_1_rad},
    {"spin_down_imbalance_sin_rad_s2", &ModelSettings::spin_down_imbalance_sin_rad_s2},
    {"spin_down_imbalance_cos_rad_s2", &ModelSettings::spin_down_imbalance_cos_rad_s2}};

/// The fit's value of a parameter in one arc.
std::optional<double> value_of(const data::Fit& fit, const std::string& name, std::size_t arc) {
  const data::FitParameter* found =
      kStart.contains(name) ? fit.find_state(name, arc) : fit.find(name, arc);
  return found != nullptr ? std::optional(found->value) : std::nullopt;
}

/// An air couple has one coefficient for both transverse axes and one for the symmetry axis.
void set_air(const data::Fit& fit, const std::string& name, std::size_t arc,
             std::optional<Eigen::Vector3d>& couple) {
  const auto across = value_of(fit, name + "[1]", arc), along = value_of(fit, name + "[3]", arc);
  if (!across && !along) return;
  Eigen::Vector3d value = couple.value_or(Eigen::Vector3d::Zero());
  const double ratio = value[0] > 0.0 ? value[1] / value[0] : 1.0;
  if (across) value.head<2>() = Eigen::Vector2d(*across, ratio * *across);
  if (along) value[2] = *along;
  couple = value;
}

/// A top's motion depends on a = m g l / I, b = Is omega_s / I and l: bodies that have these. Its
/// moments are about the pivot, whatever the scene's body looks like.
void set_top(const data::Fit& fit, std::size_t arc, data::Scene& scene) {
  constexpr double kAnySpin_rad_s = 1.0;
  const auto a = value_of(fit, "a_1_s2", arc), b = value_of(fit, "b_1_s", arc),
             l = value_of(fit, "l_m", arc);
  if (!a || !b || !l) return;
  if (!scene.body) scene.body.emplace();
  data::Body& body = *scene.body;
  body.kind = data::BodyKind::top;
  const double weight_arm_m2_s2 = scene.model.gravity_m_s2 * *l;
  body.l_m = *l;
  body.I_kg_m2 = body.mass_kg ? *body.mass_kg * weight_arm_m2_s2 / *a : 1.0;
  if (!body.mass_kg) body.mass_kg = *a / weight_arm_m2_s2;
  const data::FitParameter* spin = fit.find("omega_s_rad_s", arc);
  const bool seen = spin != nullptr && spin->identifiable && spin->value * *b > 0.0;
  const double omega_s = seen ? spin->value : std::copysign(kAnySpin_rad_s, *b);
  scene.start.omega_s_rad_s = omega_s;
  body.Is_kg_m2 = *body.I_kg_m2 * *b / omega_s;
  if (const auto gamma = value_of(fit, "gamma1_1_s", arc))
    scene.model.drag_transverse_N_m_s = *gamma * *body.I_kg_m2;
  if (const auto gamma = value_of(fit, "gamma3_1_s", arc))
    scene.model.drag_spin_N_m_s = *gamma * *body.Is_kg_m2;
  if (const auto dry = value_of(fit, "gamma3_dry_1_s2", arc))
    scene.model.drag_spin_dry_N_m = *dry * *body.I_kg_m2;
  if (const auto quadratic = value_of(fit, "gamma3_quadratic", arc))
    scene.model.drag_spin_quadratic_N_m_s2 =
        *quadratic * *body.Is_kg_m2 * *body.Is_kg_m2 / *body.I_kg_m2;
  Eigen::Vector3d pivot_m = scene.support.pivot_m.value_or(Eigen::Vector3d::Zero());
  pivot_m.x() = value_of(fit, "pivot_x_m", arc).value_or(pivot_m.x());
  pivot_m.y() = value_of(fit, "pivot_y_m", arc).value_or(pivot_m.y());
  scene.support = {data::SupportKind::pivot, pivot_m};
}

}  // namespace

bool is_start(const data::FitParameter& parameter) {
  // A top's b holds the spin it was given.
  const std::string name = parameter.name.substr(0, parameter.name.find('@'));
  return kStart.contains(name) || name == "b_1_s" || name == "omega_s_rad_s";
}

double time_factor(const data::Fit& fit) {
  return value_of(fit, "frame_rate_factor", 0).value_or(1.0);
}

double arc_start_s(const data::Fit& fit, std::size_t arc) {
  return arc == 0 ? fit.time_origin_s : fit.arcs.at(arc).from_s;
}

data::Scene scene_of(const data::Fit& fit, const std::string& name) {
  data::Scene scene =
      fitting::scene_as_fitted(data::parse_scene(fit.scene_toml, "the scene stored in " + name));
  scene.model.name = fit.model;
  return scene;
}

data::Scene fitted_scene(const data::Fit& fit, std::size_t arc) {
  if (arc >= fit.arcs.size())
    throw InputError(fmt::format("the fit has {} arc{}, counted from 0: no arc {}", fit.arcs.size(),
                                 fit.arcs.size() == 1 ? "" : "s", arc));
  data::Scene scene = scene_of(fit);
  scene.start = {};
  for (const auto& [name, field] : kStart)
    if (const auto value = value_of(fit, name, arc)) scene.start.*field = value;
  for (const auto& [name, field] : kCoefficients)
    if (const auto value = value_of(fit, name, arc)) scene.model.*field = value;
  if (const auto slope = value_of(fit, "slope_x", arc)) scene.support.slope_x = slope;
  if (const auto slope = value_of(fit, "slope_y", arc)) scene.support.slope_y = slope;
  set_air(fit, "air_linear_N_m_s", arc, scene.model.air_linear_N_m_s);
  set_air(fit, "air_quadratic_N_m_s2", arc, scene.model.air_quadratic_N_m_s2);
  if (const auto scale = value_of(fit, "scale", arc)) fitting::resize(scene, *scale);
  if (fit.model == "top" || fit.model == "top-euler") set_top(fit, arc, scene);
  scene.run.until_s = time_factor(fit) * (fit.arcs[arc].to_s - arc_start_s(fit, arc));
  return scene;
}

}  // namespace trochoid::tools
