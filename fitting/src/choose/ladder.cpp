#include "choose/ladder.hpp"

#include <cmath>
#include <utility>

#include "problem/problem.hpp"
#include "trochoid/model/inertia.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::fitting {
namespace {

using data::ModelSettings;
using data::Scene;

// A term that is one number of the scene; the scene's own value is the start when it has one.
Term single(const std::string& name, std::optional<double> ModelSettings::*field,
            const Scene& scene, double typical) {
  const double start = (scene.model.*field).value_or(0.0);
  return {name,
          [field, value = start > 0.0 ? start : typical](Scene& s) { s.model.*field = value; },
          {}};
}

Term air_couple(const std::string& name, std::optional<Eigen::Vector3d> ModelSettings::*field,
                const Scene& scene, double typical) {
  const Eigen::Vector3d own = (scene.model.*field).value_or(Eigen::Vector3d::Zero());
  const Eigen::Vector3d start = own.minCoeff() > 0.0 ? own : Eigen::Vector3d::Constant(typical);
  return {name, [field, start](Scene& s) { s.model.*field = start; }, {}};
}

ModelSettings without_losses(const ModelSettings& model, const std::string& law) {
  ModelSettings plain;
  plain.name = law;
  plain.gravity_m_s2 = model.gravity_m_s2;
  plain.couple_regularisation_rad_s = model.couple_regularisation_rad_s;
  plain.slip_regularisation_m_s = model.slip_regularisation_m_s;
  return plain;
}

void add_floor_losses(const Scene& scene, Ladder& ladder) {
  const model::CentralInertia inertia = model::central_inertia(*scene.body);
  const double R = scene.body->radius_m;
  const double rate_rad_s = std::sqrt(scene.model.gravity_m_s2 / R);
  const double unit_N_m_s = inertia.mass_kg * std::sqrt(scene.model.gravity_m_s2 * R * R * R);
  // Losses that end a spin within seconds: thousandths of the natural units.
  constexpr double kTypical = 2e-3;
  if (inertia.mass_known) {
    ladder.terms.push_back(
        air_couple("air couple", &ModelSettings::air_linear_N_m_s, scene, kTypical * unit_N_m_s));
    ladder.terms.back().usual = true;
    ladder.terms.push_back(air_couple("quadratic air couple", &ModelSettings::air_quadratic_N_m_s2,
                                      scene, kTypical * unit_N_m_s / rate_rad_s));
    ladder.terms.back().other_law_of = 0;
    ladder.terms.push_back(single("air force", &ModelSettings::air_force_N_s_m, scene,
                                  kTypical * inertia.mass_kg * rate_rad_s));
    ladder.terms.push_back(
        single("gap layer", &ModelSettings::gap_viscosity_Pa_s, scene, kAirViscosity_Pa_s));
  } else {
    ladder.left_out.push_back("air couples, air force and the gap layer (need body.mass_kg)");
  }
  const auto friction = [&](const char* name, std::optional<double> ModelSettings::*field) {
    ladder.terms.push_back(single(name, field, scene, kTypical * R));
  };
  for (const auto& [name, field] :
       {std::pair{"rolling friction", &ModelSettings::rolling_friction_m},
        {"pivoting friction", &ModelSettings::pivoting_friction_m}}) {
    friction(name, field);
    ladder.terms.back().usual = true;
  }
  friction("contour friction", &ModelSettings::contour_friction_m);
}

// What a floor may do instead of letting the body roll.
void add_floors(const Scene& scene, Ladder& ladder) {
  Term sliding = single("sliding", &ModelSettings::friction, scene, 0.3);
  sliding.switch_on = [set = sliding.switch_on](Scene& s) {
    set(s);
    s.model.name = "sliding";
  };
  sliding.last_resort = true;
  ladder.terms.push_back(std::move(sliding));
  Term smooth{"no friction", [](Scene& s) { s.model.name = "smooth"; }, {}};
  smooth.last_resort = smooth.smooth = true;
  ladder.terms.push_back(std::move(smooth));
}

// A scene that speaks of the slope itself has it in every model, or in none.
void add_slope(Ladder& ladder) {
  if (parameters_of(ladder.plain).contains(kSlopeX)) return;
  Term slope{"slope",
             [](Scene& s) {
               s.support.slope_x = s.support.slope_y = 0.0;
               for (const char* name : {kSlopeX, kSlopeY}) s.fit.free.emplace_back(name);
             },
             {}};
  slope.slope = true;
  ladder.terms.push_back(std::move(slope));
}

void add_spin_down_terms(const Scene& scene, Ladder& ladder) {
  ladder.terms = {
      single("dry couple", &ModelSettings::spin_down_dry_rad_s2, scene, 0.1),
      single("viscous couple", &ModelSettings::spin_down_viscous_1_s, scene, 0.1),
      single("quadratic couple", &ModelSettings::spin_down_quadratic_1_rad, scene, 0.01),
      {"imbalance",
       [](Scene& s) {
         s.model.spin_down_imbalance_sin_rad_s2 = 0.0;
         s.model.spin_down_imbalance_cos_rad_s2 = 0.0;
       },
       {}}};
  ladder.terms.push_back(
      single("weakening with speed", &ModelSettings::spin_down_weakening_s_rad, scene, 0.1));
  ladder.terms.back().of = 0;  // of dry friction
}

// Friction that spin weakens looks like air that slows: the path has to choose between them.
Term unseen_spin(const Scene& scene) {
  constexpr double kFastest = 4.0;  // of the natural rate: a rim of 4 sqrt(g R)
  const double rate_rad_s = std::sqrt(scene.model.gravity_m_s2 / scene.body->radius_m);
  return {"unseen spin",
          [rate_rad_s](Scene& s) {
            s.fit.prior["w3_rad_s"] = {0.0, kFastest * rate_rad_s};
          },
          {}};
}

void add_puck_terms(const Scene& scene, bool spin_seen, Ladder& ladder) {
  if (scene.body->mass_kg)
    ladder.terms.push_back(
        single("air force", &ModelSettings::air_force_N_s_m, scene, 0.05 * *scene.body->mass_kg));
  else
    ladder.left_out.push_back("air force (needs body.mass_kg)");
  if (!spin_seen && !scene.fit.fixed.contains("w3_rad_s") && !scene.fit.prior.contains("w3_rad_s"))
    ladder.terms.push_back(unseen_spin(scene));
}

// Air acts on nearly every top, along and across its axis; at the pivot's tip, or where the air is
// turbulent, the spin goes by another law.
void add_top_drags(Ladder& ladder) {
  constexpr double kTypical_1_s = 0.05;
  const auto drag = [](std::optional<double> ModelSettings::*field) {
    // Tops are fitted by groups, whose starts are other ones.
    return [field](Scene& s) { s.model.*field = 1e-6; };
  };
  ladder.terms = {
      {"transverse drag",
       drag(&ModelSettings::drag_transverse_N_m_s),
       {{"gamma1_1_s", kTypical_1_s}}},
      {"spin drag", drag(&ModelSettings::drag_spin_N_m_s), {{"gamma3_1_s", kTypical_1_s}}},
      {"dry spin drag", drag(&ModelSettings::drag_spin_dry_N_m), {}},
      {"quadratic spin drag", drag(&ModelSettings::drag_spin_quadratic_N_m_s2), {}}};
  ladder.terms[0].usual = ladder.terms[1].usual = true;
  ladder.terms[2].other_law_of = ladder.terms[3].other_law_of = 1;
}

}  // namespace

Ladder ladder_of(const Scene& scene, bool spin_seen) {
  Ladder ladder;
  Scene named = scene;
  // Any friction will do to ask which law the scene's support stands for.
  if (!named.model.friction) named.model.friction = 0.2;
  if (scene.model.name == "auto" && scene.support.kind == data::SupportKind::floor)
    named.model.friction.reset();
  ladder.law = model::make_predictor(named)->model_name();
  if (ladder.law == "sliding") ladder.law = "rolling";
  ladder.plain = scene;
  ladder.plain.model = without_losses(scene.model, ladder.law);
  if (ladder.law == "rolling" || ladder.law == "smooth") add_floor_losses(scene, ladder);
  if (ladder.law == "rolling") {
    add_floors(scene, ladder);
  } else if (ladder.law == "puck") {
    ladder.plain.model.friction = scene.model.friction.value_or(0.2);
    add_puck_terms(scene, spin_seen, ladder);
  } else if (ladder.law == "pivot") {
    add_spin_down_terms(scene, ladder);
  } else if (ladder.law == "top") {
    add_top_drags(ladder);
  }
  if (ladder.law == "rolling" || ladder.law == "smooth" || ladder.law == "puck") add_slope(ladder);
  return ladder;
}

}  // namespace trochoid::fitting
