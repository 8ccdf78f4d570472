#include "trochoid/data/reference_case.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "json_read.hpp"

namespace trochoid::data {
namespace {

std::optional<double> nonzero(const JsonReader& json, const char* key) {
  const double value = json.number_or(key, 0.0);
  return value == 0.0 ? std::nullopt : std::optional(value);
}

std::optional<Eigen::Vector3d> nonzero_vector(const JsonReader& json, const char* key) {
  if (!json.has(key)) return std::nullopt;
  const std::vector<double> v = json.numbers(key, 3);
  if (std::all_of(v.begin(), v.end(), [](double c) { return c == 0.0; })) return std::nullopt;
  return Eigen::Vector3d(v[0], v[1], v[2]);
}

std::optional<double> optional_number(const JsonReader& json, const char* key) {
  return json.has(key) ? std::optional(json.number(key)) : std::nullopt;
}

void read_angles(const JsonReader& initial, StartSettings& start) {
  start.theta_rad = initial.number("theta");
  start.phi_rad = initial.number_or("phi", 0.0);
  start.psi_rad = initial.number_or("psi", 0.0);
}

// M0, M1: principal moments and body rates.
void read_free_body(const JsonReader& params, const JsonReader& initial, Scene& scene) {
  scene.support.kind = SupportKind::none;
  scene.model.name = "free";
  read_angles(initial, scene.start);
  scene.start.moments_kg_m2 =
      Eigen::Vector3d(params.number("Ix"), params.number("Iy"), params.number("Iz"));
  scene.start.w_body_rad_s =
      Eigen::Vector3d(initial.number("wx"), initial.number("wy"), initial.number("wz"));
}

// M2: moments about the pivot, which is the origin.
void read_top(const JsonReader& params, const JsonReader& initial, Scene& scene) {
  scene.support.kind = SupportKind::pivot;
  scene.support.pivot_m = Eigen::Vector3d::Zero();
  scene.model.name = "top";
  Body body;
  body.kind = BodyKind::top;
  body.mass_kg = params.number("m");
  body.I_kg_m2 = params.number("I");
  body.Is_kg_m2 = params.number("Is");
  body.l_m = params.number("l");
  scene.body = body;
  scene.model.drag_transverse_N_m_s = nonzero(params, "c1");
  scene.model.drag_spin_N_m_s = nonzero(params, "c3");
  read_angles(initial, scene.start);
  scene.start.dphi_rad_s = initial.number_or("dphi", 0.0);
  scene.start.dtheta_rad_s = initial.number_or("dtheta", 0.0);
  scene.start.omega_s_rad_s = params.number("omega_s");
}

void read_contact_terms(const JsonReader& params, ModelSettings& model) {
  model.air_linear_N_m_s = nonzero_vector(params, "c_air");
  model.air_quadratic_N_m_s2 = nonzero_vector(params, "q_air");
  model.air_force_N_s_m = nonzero(params, "c_v");
  model.gap_viscosity_Pa_s = nonzero(params, "eta");
  model.rolling_friction_m = nonzero(params, "mu_r");
  model.pivoting_friction_m = nonzero(params, "mu_p");
  model.contour_friction_m = nonzero(params, "mu_c");
  if (model.rolling_friction_m || model.pivoting_friction_m || model.contour_friction_m)
    model.couple_regularisation_rad_s = nonzero(params, "eps_omega");
}

std::string contact_law(const std::string& rung, const JsonReader& params,
                        const JsonReader& initial) {
  if (rung == "M3") return "smooth";
  if (rung == "M4" || initial.text_or("velocity", "") == "rolling") return "rolling";
  return params.number_or("mu", 0.0) == 0.0 ? "smooth" : "sliding";
}

Body contact_body(const JsonReader& params) {
  Body body;
  body.kind = params.text_or("kind", "disc") == "ring" ? BodyKind::ring : BodyKind::disc;
  body.radius_m = params.number("R");
  body.inner_radius_m = params.number_or("R_inner", 0.0);
  body.thickness_m = 2.0 * params.number("h");
  body.mass_kg = params.number("m");
  body.I_kg_m2 = params.number("A");
  body.Is_kg_m2 = params.number("C");
  return body;
}

// M3 to M6: a disc or ring of half thickness h with its rim on the floor.
void read_contact(const std::string& rung, const JsonReader& params, const JsonReader& initial,
                  Scene& scene) {
  scene.support.kind = SupportKind::floor;
  scene.body = contact_body(params);
  read_contact_terms(params, scene.model);
  scene.model.name = contact_law(rung, params, initial);
  if (scene.model.name == "sliding") {
    scene.model.friction = params.number("mu");
    scene.model.slip_regularisation_m_s = nonzero(params, "eps_v");
  }
  read_angles(initial, scene.start);
  scene.start.w1_rad_s = initial.number("w1");
  scene.start.w2_rad_s = initial.number("w2");
  scene.start.w3_rad_s = initial.number("w3");
  scene.start.x_m = initial.number_or("x", 0.0);
  scene.start.y_m = initial.number_or("y", 0.0);
  if (scene.model.name != "rolling") {
    scene.start.vx_m_s = optional_number(initial, "vx");
    scene.start.vy_m_s = optional_number(initial, "vy");
  }
}

void read_motion(const std::string& rung, const JsonReader& json, const JsonReader& params,
                 const JsonReader& initial, Scene& scene) {
  if (rung == "M0" || rung == "M1") return read_free_body(params, initial, scene);
  if (rung == "M2") return read_top(params, initial, scene);
  if (rung == "M3" || rung == "M4" || rung == "M5" || rung == "M6")
    return read_contact(rung, params, initial, scene);
  json.fail(fmt::format("\"model\" = \"{}\" must be one of M0 .. M6", rung));
}

}  // namespace

ReferenceCase read_reference_case(const std::filesystem::path& path) {
  const nlohmann::json object = read_json_object(path);
  const JsonReader json(object, path.string());
  for (const char* key : {"params", "initial"})
    if (!json.at(key).is_object()) json.fail(fmt::format("\"{}\" must be an object", key));
  const JsonReader params(json.at("params"), path.string() + ": params");
  const JsonReader initial(json.at("initial"), path.string() + ": initial");
  ReferenceCase result;
  result.name = json.text_or("name", path.stem().string());
  result.rung = json.text("model");
  Scene& scene = result.scene;
  scene.model.gravity_m_s2 = params.number_or("g", 9.81);
  scene.run.until_s = json.number("t_end");
  scene.run.rate_hz = json.number("fs");
  if (scene.run.until_s <= 0.0 || scene.run.rate_hz <= 0.0)
    json.fail("\"t_end\" and \"fs\" must be greater than 0");
  read_motion(result.rung, json, params, initial, scene);
  return result;
}

}  // namespace trochoid::data
