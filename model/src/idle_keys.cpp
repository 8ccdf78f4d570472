#include "trochoid/model/idle_keys.hpp"

#include <algorithm>
#include <array>
#include <string_view>

#include "factories.hpp"
#include "trochoid/data/given_keys.hpp"

namespace trochoid::model {
namespace {

struct Readers {
  std::string_view key;
  std::vector<std::string_view> models;
};

/// Keys that not every model reads. A regularisation goes with the law it smooths, and is not
/// spoken of without it.
const std::vector<Readers>& readers() {
  const std::vector<std::string_view> rim{"rolling", "smooth", "sliding"};
  const std::vector<std::string_view> top{"top", "top-euler"};
  const std::vector<std::string_view> leaning{"rolling", "smooth",    "sliding",
                                              "top",     "top-euler", "free"};
  const std::vector<std::string_view> floor{"rolling", "smooth", "sliding", "puck"};
  static const std::vector<Readers> list{
      {"support.pivot_m", {"top", "top-euler", "pivot"}},
      {"support.slope_x", floor},
      {"support.slope_y", floor},
      {"model.gravity_m_s2", {"rolling", "smooth", "sliding", "top", "top-euler", "puck"}},
      {"model.air_linear_N_m_s", rim},
      {"model.air_quadratic_N_m_s2", rim},
      {"model.air_force_N_s_m", floor},
      {"model.gap_viscosity_Pa_s", rim},
      {"model.friction", {"sliding", "puck"}},
      {"model.slip_regularisation_m_s", rim},
      {"model.contact_radius_m", {"puck"}},
      {"model.rolling_friction_m", rim},
      {"model.pivoting_friction_m", rim},
      {"model.contour_friction_m", rim},
      {"model.couple_regularisation_rad_s", rim},
      {"model.drag_transverse_N_m_s", top},
      {"model.drag_spin_N_m_s", top},
      {"model.drag_spin_dry_N_m", top},
      {"model.drag_spin_quadratic_N_m_s2", top},
      {"model.spin_down_dry_rad_s2", {"pivot"}},
      {"model.spin_down_weakening_s_rad", {"pivot"}},
      {"model.spin_down_viscous_1_s", {"pivot"}},
      {"model.spin_down_quadratic_1_rad", {"pivot"}},
      {"model.spin_down_imbalance_sin_rad_s2", {"pivot"}},
      {"model.spin_down_imbalance_cos_rad_s2", {"pivot"}},
      {"start.theta_rad", leaning},
      {"start.phi_rad", leaning},
      {"start.w1_rad_s", leaning},
      {"start.w2_rad_s", leaning},
      {"start.dtheta_rad_s", leaning},
      {"start.dphi_rad_s", leaning},
      {"start.omega_s_rad_s", {"top", "top-euler", "pivot", "free"}},
      {"start.x_m", floor},
      {"start.y_m", floor},
      {"start.vx_m_s", {"smooth", "sliding", "puck"}},
      {"start.vy_m_s", {"smooth", "sliding", "puck"}},
      {"start.w_body_rad_s", {"free"}},
      {"start.moments_kg_m2", {"free"}},
      {"run.rim_switch", rim}};
  return list;
}

/// Whether a model is one of bodies held as the scene says, where it says other than a floor.
bool is_held_so(const data::Scene& scene, const std::string& law) {
  switch (scene.support.kind) {
    case data::SupportKind::flat:
      return law == "puck";
    case data::SupportKind::pivot:
      return law == "top" || law == "top-euler" || law == "pivot";
    case data::SupportKind::none:
      return law == "free";
    case data::SupportKind::floor:
      break;
  }
  return true;
}

/// A body in flight whose three rates are given together looks at no other rate.
bool passed_over(const data::Scene& scene, const std::string& law, std::string_view key) {
  constexpr std::array<std::string_view, 7> kRates{
      "start.w1_rad_s",   "start.w2_rad_s",   "start.w3_rad_s",     "start.dtheta_rad_s",
      "start.dphi_rad_s", "start.dpsi_rad_s", "start.omega_s_rad_s"};
  return law == "free" && scene.start.w_body_rad_s &&
         std::find(kRates.begin(), kRates.end(), key) != kRates.end();
}

}  // namespace

std::vector<std::string> idle_keys(const data::Scene& scene) {
  std::vector<std::string> idle = data::given_keys(scene);
  const std::string law = law_of(scene);
  std::erase_if(idle, [&](const std::string& key) {
    if (passed_over(scene, law, key)) return false;
    if (key == "support.kind") return is_held_so(scene, law);
    const auto found = std::find_if(readers().begin(), readers().end(),
                                    [&](const Readers& known) { return known.key == key; });
    return found == readers().end() ||
           std::find(found->models.begin(), found->models.end(), law) != found->models.end();
  });
  return idle;
}

}  // namespace trochoid::model
