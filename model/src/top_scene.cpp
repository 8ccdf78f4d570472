#include "top_scene.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/model/inertia.hpp"

namespace trochoid::model {
namespace {

double positive(double value, const char* field) {
  if (!(value > 0.0) || !std::isfinite(value))
    throw InputError(fmt::format("{} = {} must be greater than 0", field, value));
  return value;
}

/// Pivot to CoM, if it is stated.
std::optional<double> pivot_distance_m(const data::Scene& scene) {
  if (!scene.body || !scene.body->l_m) return std::nullopt;
  return positive(*scene.body->l_m, "body.l_m");
}

struct PivotMoments {
  double across, along;
};
/// About the pivot: stated for a top, I = A + m l^2 and Is = C for a body with a shape.
PivotMoments moments_about_pivot_kg_m2(const data::Body& body, double l_m) {
  if (body.kind == data::BodyKind::top) {
    if (!body.I_kg_m2 || !body.Is_kg_m2) {
      throw InputError(
          "a top needs body.I_kg_m2 and body.Is_kg_m2 (about the pivot), or kind = \"disc\" with "
          "radius_m, thickness_m, mass_kg and l_m");
    }
    return {*body.I_kg_m2, *body.Is_kg_m2};
  }
  const CentralInertia central = central_inertia(body);
  return {central.transverse_kg_m2 + central.mass_kg * l_m * l_m, central.axial_kg_m2};
}

bool knows_moments(const data::Body& body) {
  if (body.kind == data::BodyKind::top) return body.I_kg_m2 && body.Is_kg_m2;
  return body.mass_kg.has_value();
}

double omega_s(const data::StartSettings& start, double theta_rad, double dphi_rad_s,
               double fallback) {
  if (start.omega_s_rad_s) return *start.omega_s_rad_s;
  if (start.w3_rad_s) return *start.w3_rad_s;
  if (start.dpsi_rad_s) return *start.dpsi_rad_s + dphi_rad_s * std::cos(theta_rad);
  return fallback;
}

void read_start(const data::StartSettings& start, TopSettings& top) {
  top.phi_rad = start.phi_rad.value_or(0.0);
  top.psi_rad = start.psi_rad.value_or(0.0);
  top.dtheta_rad_s = start.dtheta_rad_s.value_or(start.w1_rad_s.value_or(0.0));
  top.dphi_rad_s = start.dphi_rad_s.value_or(0.0);
  if (start.w2_rad_s && !start.dphi_rad_s) {
    const double s = std::sin(top.theta_rad);
    if (s == 0.0) throw InputError("start.w2_rad_s says nothing at theta_rad = 0; give dphi_rad_s");
    top.dphi_rad_s = *start.w2_rad_s / s;
  }
  top.omega_s_rad_s = omega_s(start, top.theta_rad, top.dphi_rad_s, 1.0);
}

void read_body(const data::Scene& scene, TopSettings& top) {
  const data::Body& body = *scene.body;
  const PivotMoments moments = moments_about_pivot_kg_m2(body, top.l_m);
  top.I_kg_m2 = positive(moments.across, "body.I_kg_m2");
  top.Is_kg_m2 = positive(moments.along, "body.Is_kg_m2");
  top.b_1_s = top.Is_kg_m2 * top.omega_s_rad_s / top.I_kg_m2;
  top.gamma1_1_s = scene.model.drag_transverse_N_m_s.value_or(0.0) / top.I_kg_m2;
  top.gamma3_1_s = scene.model.drag_spin_N_m_s.value_or(0.0) / top.Is_kg_m2;
  top.dry_1_s2 = scene.model.drag_spin_dry_N_m.value_or(0.0) / top.I_kg_m2;
  top.quadratic = scene.model.drag_spin_quadratic_N_m_s2.value_or(0.0) * top.I_kg_m2 /
                  (top.Is_kg_m2 * top.Is_kg_m2);
  if (body.mass_kg) {
    top.weight_times_l_J = *body.mass_kg * scene.model.gravity_m_s2 * top.l_m;
    top.a_1_s2 = top.weight_times_l_J / top.I_kg_m2;
  }
}

void check(const TopSettings& top) {
  if (!(top.theta_rad >= 0.0) || top.theta_rad > data::kPi)
    throw InputError(fmt::format("start.theta_rad = {} must lie between 0 and pi", top.theta_rad));
  const std::pair<const char*, double> numbers[] = {
      {"weight times l over I (body.mass_kg, l_m, I_kg_m2)", top.a_1_s2},
      {"Is omega_s over I (body.Is_kg_m2, I_kg_m2)", top.b_1_s},
      {"start.phi_rad", top.phi_rad},
      {"start.psi_rad", top.psi_rad},
      {"start.dtheta_rad_s", top.dtheta_rad_s},
      {"start.dphi_rad_s", top.dphi_rad_s},
      {"the spin start.omega_s_rad_s", top.omega_s_rad_s}};
  for (const auto& [what, value] : numbers)
    if (!std::isfinite(value)) throw InputError(fmt::format("{} = {} must be finite", what, value));
}

void check_drag(const data::ModelSettings& model) {
  const std::pair<const char*, std::optional<double>> drags[] = {
      {"drag_transverse_N_m_s", model.drag_transverse_N_m_s},
      {"drag_spin_N_m_s", model.drag_spin_N_m_s},
      {"drag_spin_dry_N_m", model.drag_spin_dry_N_m},
      {"drag_spin_quadratic_N_m_s2", model.drag_spin_quadratic_N_m_s2}};
  for (const auto& [key, drag] : drags)
    if (drag && !(*drag >= 0.0 && std::isfinite(*drag)))
      throw InputError(fmt::format("model.{} = {} must be 0 or greater", key, *drag));
}

TopSettings common(const data::Scene& scene) {
  check_drag(scene.model);
  TopSettings top;
  top.transverse_drag = scene.model.drag_transverse_N_m_s.has_value();
  top.spin_drag = scene.model.drag_spin_N_m_s.has_value();
  top.dry_drag = scene.model.drag_spin_dry_N_m.has_value();
  top.quadratic_drag = scene.model.drag_spin_quadratic_N_m_s2.has_value();
  top.drag = top.transverse_drag || top.spin_drag || top.dry_drag || top.quadratic_drag;
  top.l_m = pivot_distance_m(scene).value_or(0.1);
  top.theta_rad = scene.start.theta_rad.value_or(data::kPi / 4.0);
  if (scene.support.pivot_m) {
    top.pivot_x_m = scene.support.pivot_m->x();
    top.pivot_y_m = scene.support.pivot_m->y();
  }
  read_start(scene.start, top);
  return top;
}

}  // namespace

TopSettings top_for_prediction(const data::Scene& scene) {
  TopSettings top = common(scene);
  if (scene.body && knows_moments(*scene.body)) {
    read_body(scene, top);
  } else if (top.drag) {
    constexpr double kStart_1_s = 0.1;  // somewhere to start: a tenth of the speed per second
    if (top.transverse_drag) top.gamma1_1_s = kStart_1_s;
    if (top.spin_drag) top.gamma3_1_s = kStart_1_s;
    if (top.dry_drag) top.dry_1_s2 = kStart_1_s * std::abs(top.b_1_s);
    if (top.quadratic_drag && top.b_1_s != 0.0) top.quadratic = kStart_1_s / std::abs(top.b_1_s);
  }
  check(top);
  return top;
}

TopSettings top_for_simulation(const data::Scene& scene) {
  if (!scene.body) throw InputError("model \"top\" needs a [body] table");
  if (!scene.body->l_m) throw InputError("body.l_m is missing; the distance from pivot to CoM [m]");
  if (!scene.body->mass_kg)
    throw InputError("body.mass_kg is missing; a top's weight moves it [kg]");
  positive(*scene.body->mass_kg, "body.mass_kg");
  if (!scene.start.theta_rad) throw InputError("start.theta_rad is missing; the tilt at the start");
  if (!scene.start.omega_s_rad_s && !scene.start.w3_rad_s && !scene.start.dpsi_rad_s)
    throw InputError("start.omega_s_rad_s is missing; the spin about the own axis [rad/s]");
  TopSettings top = common(scene);
  read_body(scene, top);
  check(top);
  return top;
}

double spin_lasts_s(double b_1_s, double dry_1_s2, double gamma3_1_s, double quadratic) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  if (!(dry_1_s2 > 0.0)) return kInfinity;
  // b = N/M with N' = -dry M - gamma3 N and M' = quadratic N, both linear: N, and with it the spin,
  // is zero where tanh(root t)/root equals this.
  const double spin = std::abs(b_1_s);
  const double length = spin / (dry_1_s2 + 0.5 * gamma3_1_s * spin);
  const double root2 = 0.25 * gamma3_1_s * gamma3_1_s - dry_1_s2 * quadratic;
  const double x = std::min(std::sqrt(std::abs(root2)) * length, root2 > 0.0 ? 1.0 : kInfinity);
  constexpr double kSeries = 1e-4;  // next term x^4/5
  if (x < kSeries) return length * (1.0 + root2 * length * length / 3.0);
  return length * (root2 > 0.0 ? std::atanh(x) : std::atan(x)) / x;
}

TopSettings without_drag(const TopSettings& top) {
  if (top.drag) {
    throw InputError(
        "model \"top-euler\" is the thesis' frictionless top; leave drag_transverse_N_m_s and "
        "drag_spin_* out, or use model \"top\"");
  }
  if (top.theta_rad == 0.0 || top.theta_rad == data::kPi)
    throw InputError("model \"top-euler\" is singular at theta_rad = 0 and pi; use model \"top\"");
  return top;
}

}  // namespace trochoid::model
