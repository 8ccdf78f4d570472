#include "rim_setup.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/model/inertia.hpp"

namespace trochoid::model {

const char* const kLossNames[kLosses] = {
    "air_linear_N_m_s[1]",     "air_linear_N_m_s[3]", "air_quadratic_N_m_s2[1]",
    "air_quadratic_N_m_s2[3]", "air_force_N_s_m",     "gap_viscosity_Pa_s",
    "rolling_friction_m",      "pivoting_friction_m", "contour_friction_m"};

namespace {

struct LossWords {
  const char* unit;
  const char* meaning;
};
constexpr LossWords kLossWords[kLosses] = {
    {"N m s", "air couple against turning about a diameter"},
    {"N m s", "air couple against spinning about the axis"},
    {"N m s^2", "quadratic air couple about a diameter"},
    {"N m s^2", "quadratic air couple about the axis"},
    {"N s/m", "air force on the centre of mass"},
    {"Pa s", "viscosity of the air layer below the disc"},
    {"m", "rolling friction: lever arm of the normal force"},
    {"m", "pivoting friction: lever arm of the normal force"},
    {"m", "contour friction: lever arm of the normal force"}};

void check_tilt(double theta_rad) {
  if (!(theta_rad > 0.0 && theta_rad < data::kPi))
    throw InputError(fmt::format("start.theta_rad = {} must lie between 0 and pi", theta_rad));
}

void fill_angles(const data::StartSettings& given, RimStart& start) {
  check_tilt(start.theta_rad);
  start.phi_rad = given.phi_rad.value_or(0.0);
  start.psi_rad = given.psi_rad.value_or(0.0);
  start.x_m = given.x_m.value_or(0.0);
  start.y_m = given.y_m.value_or(0.0);
}

void fill_rates(const data::StartSettings& given, double typical_w2, RimStart& start) {
  const double s = std::sin(start.theta_rad), c = std::cos(start.theta_rad);
  start.w1_rad_s = given.w1_rad_s.value_or(given.dtheta_rad_s.value_or(0.0));
  start.w2_rad_s = given.dphi_rad_s ? *given.dphi_rad_s * s : given.w2_rad_s.value_or(typical_w2);
  start.w3_rad_s =
      given.dpsi_rad_s ? *given.dpsi_rad_s + start.w2_rad_s * c / s : given.w3_rad_s.value_or(0.0);
}

void fill_velocity(const data::StartSettings& given, const RimBody& body, RimStart& start) {
  RimBody placed = body;
  placed.side = touching_side(start.theta_rad, start.w1_rad_s);
  const double z = tilt(placed, start.theta_rad).z;
  const Horizontal<double> rolling{placed.signed_h() * start.w2_rad_s - body.R * start.w3_rad_s,
                                   -z * start.w1_rad_s};
  const World<double> v = world_from_node(rolling, start.phi_rad);
  start.vx_m_s = given.vx_m_s.value_or(given.vy_m_s ? 0.0 : v.x);
  start.vy_m_s = given.vy_m_s.value_or(given.vx_m_s ? 0.0 : v.y);
}

bool needs_mass(const data::ModelSettings& model, std::string& term) {
  if (model.air_linear_N_m_s) term = "air_linear_N_m_s";
  if (model.air_quadratic_N_m_s2) term = "air_quadratic_N_m_s2";
  if (model.air_force_N_s_m) term = "air_force_N_s_m";
  if (model.gap_viscosity_Pa_s) term = "gap_viscosity_Pa_s";
  return !term.empty();
}

}  // namespace

RimBody rim_body(const data::Body& body, double gravity_m_s2) {
  if (!(gravity_m_s2 > 0.0))
    throw InputError(fmt::format("gravity_m_s2 = {} must be greater than 0", gravity_m_s2));
  const CentralInertia inertia = central_inertia(body);
  return {.m = inertia.mass_kg,
          .A = inertia.transverse_kg_m2,
          .C = inertia.axial_kg_m2,
          .R = body.radius_m,
          .h = body.half_thickness_m(),
          .g = gravity_m_s2};
}

RimBody rim_body(const data::Scene& scene) {
  if (!scene.body) throw InputError("[body] is missing: this model needs kind and radius_m");
  std::string term;
  if (!central_inertia(*scene.body).mass_known && needs_mass(scene.model, term))
    throw InputError(fmt::format(
        "body.mass_kg is missing: model.{} acts as coefficient over mass; weigh the body", term));
  return rim_body(*scene.body, scene.model.gravity_m_s2);
}

RimStart rim_start(const data::Scene& scene, const RimBody& body) {
  const data::StartSettings& given = scene.start;
  if (!given.theta_rad)
    throw InputError("start.theta_rad is missing: the tilt of the symmetry axis, pi/2 = on edge");
  RimStart start;
  start.theta_rad = *given.theta_rad;
  fill_angles(given, start);
  fill_rates(given, 0.0, start);
  fill_velocity(given, body, start);
  return start;
}

RimStart rim_start_or_typical(const data::Scene& scene, const RimBody& body) {
  const data::StartSettings& given = scene.start;
  constexpr double kTypicalTilt_rad = 0.8;
  RimStart start;
  start.theta_rad = given.theta_rad.value_or(kTypicalTilt_rad);
  fill_angles(given, start);
  const double s = std::sin(start.theta_rad);
  const double precession = std::sqrt(body.m * body.g * body.R / (body.A * s));
  fill_rates(given, precession * s, start);
  fill_velocity(given, body, start);
  return start;
}

LossValues<double> loss_values(const data::ModelSettings& model) {
  LossValues<double> v;
  const auto vector = [](const std::optional<Eigen::Vector3d>& c, const char* key, double& first,
                         double& third, double& ratio) {
    const Eigen::Vector3d value = c.value_or(Eigen::Vector3d::Zero());
    first = value[0];
    third = value[2];
    if (!(value[1] >= 0.0) || !std::isfinite(value[1]) || (value[0] == 0.0 && value[1] != 0.0))
      throw InputError(fmt::format(
          "model.{}: the second transverse coefficient is {}, the first {}; both must be 0 or "
          "greater, and the second 0 where the first is",
          key, value[1], value[0]));
    if (value[0] > 0.0) ratio = value[1] / value[0];
  };
  const auto of = [&v](Loss loss) -> double& { return v.value[static_cast<int>(loss)]; };
  vector(model.air_linear_N_m_s, "air_linear_N_m_s", of(Loss::air1), of(Loss::air3), v.air_ratio);
  vector(model.air_quadratic_N_m_s2, "air_quadratic_N_m_s2", of(Loss::quadratic1),
         of(Loss::quadratic3), v.quadratic_ratio);
  of(Loss::force) = model.air_force_N_s_m.value_or(0.0);
  of(Loss::gap) = model.gap_viscosity_Pa_s.value_or(0.0);
  of(Loss::rolling) = model.rolling_friction_m.value_or(0.0);
  of(Loss::pivoting) = model.pivoting_friction_m.value_or(0.0);
  of(Loss::contour) = model.contour_friction_m.value_or(0.0);
  v.eps_w = model.couple_regularisation_rad_s.value_or(v.eps_w);
  if (!(v.eps_w > 0.0) || !std::isfinite(v.eps_w))  // the couples would be 0/0 where a rate is zero
    throw InputError(
        fmt::format("model.couple_regularisation_rad_s = {} must be greater than 0", v.eps_w));
  for (int i = 0; i < kLosses; ++i)
    if (!(v.value[i] >= 0.0) || !std::isfinite(v.value[i]))
      throw InputError(fmt::format("model.{} = {} must be 0 or greater: a loss takes energy",
                                   kLossNames[i], v.value[i]));
  return v;
}

std::vector<ParameterInfo> loss_parameters(const data::ModelSettings& model) {
  const LossValues<double> values = loss_values(model);
  std::vector<ParameterInfo> list;
  for (int i = 0; i < kLosses; ++i) {
    if (values.value[i] == 0.0) continue;
    ParameterInfo info;
    info.name = kLossNames[i];
    info.unit = kLossWords[i].unit;
    info.meaning = kLossWords[i].meaning;
    info.lower = 0.0;
    info.upper = std::numeric_limits<double>::infinity();
    info.logarithmic = true;
    info.value = values.value[i];
    list.push_back(info);
  }
  return list;
}

}  // namespace trochoid::model
