#include "trochoid/model/idle_keys.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "trochoid/data/io.hpp"
#include "trochoid/model/simulate.hpp"

namespace trochoid::model {
namespace {

/// A scene as "table.key" -> value.
using Keys = std::map<std::string, std::string>;

data::Scene scene_of(const Keys& keys, const std::string& model) {
  std::string toml = "run.until_s = 0.5\nrun.rate_hz = 20\nmodel.name = \"" + model + "\"\n";
  for (const auto& [key, value] : keys) toml += key + " = " + value + "\n";
  return data::parse_scene(toml, "scene");
}

const Keys& disc_on_its_rim() {
  static const Keys keys{{"body.radius_m", "0.03"},
                         {"body.thickness_m", "0.008"},
                         {"body.mass_kg", "0.03"},
                         {"model.friction", "0.05"},
                         {"model.rolling_friction_m", "1e-5"},
                         {"start.theta_rad", "1.1"},
                         {"start.w2_rad_s", "20"},
                         {"start.w3_rad_s", "3"}};
  return keys;
}
const Keys& top() {
  static const Keys keys{{"body.kind", "\"top\""},  {"body.mass_kg", "0.1"},
                         {"body.I_kg_m2", "1"},     {"body.Is_kg_m2", "1.5"},
                         {"body.l_m", "0.1"},       {"start.theta_rad", "1"},
                         {"start.w1_rad_s", "0.1"}, {"start.omega_s_rad_s", "0.5"}};
  return keys;
}
const Keys& disc_on_its_face() {
  static const Keys keys{{"body.radius_m", "0.03"},
                         {"body.mass_kg", "0.03"},
                         {"model.friction", "0.05"},
                         {"start.vx_m_s", "0.3"},
                         {"start.w3_rad_s", "2"}};
  return keys;
}
const Keys& disc_on_a_pin() {
  static const Keys keys{{"body.radius_m", "0.03"},
                         {"model.spin_down_dry_rad_s2", "0.5"},
                         {"start.omega_s_rad_s", "20"}};
  return keys;
}
const Keys& disc_in_flight() {
  static const Keys keys{{"body.radius_m", "0.03"},
                         {"body.mass_kg", "0.03"},
                         {"start.w1_rad_s", "1"},
                         {"start.w2_rad_s", "2"},
                         {"start.omega_s_rad_s", "3"}};
  return keys;
}

bool run_alike(const data::Scene& one, const data::Scene& other) {
  const Eigen::MatrixXd a = simulate(one).values, b = simulate(other).values;
  return a.rows() == b.rows() && (a.array() == b.array() || a.array().isNaN()).all();
}

struct Motion {
  const char* model;
  const Keys& (*keys)();
};
class IdleKeys : public testing::TestWithParam<Motion> {};

TEST_P(IdleKeys, AreThoseThatChangeNothing) {
  const auto& [model, keys] = GetParam();
  const data::Scene plain = scene_of(keys(), model);
  Keys changes{{"model.air_linear_N_m_s", "[1e-6, 1e-6, 1e-6]"},
               {"model.air_quadratic_N_m_s2", "[1e-6, 1e-6, 1e-6]"},
               {"model.couple_regularisation_rad_s", "0.1"},
               {"model.gravity_m_s2", "3.7"},
               {"model.spin_down_weakening_s_rad", "0.1"},
               {"start.moments_kg_m2", "[1e-5, 2e-5, 2.5e-5]"},
               {"start.x_m", "0.01"},
               {"start.y_m", "0.01"},
               {"start.vx_m_s", "0.2"},
               {"start.vy_m_s", "0.2"},
               {"start.theta_rad", "0.9"},
               {"start.phi_rad", "0.9"},
               {"start.psi_rad", "0.9"},
               {"start.w1_rad_s", "4"},
               {"start.w2_rad_s", "4"},
               {"start.w3_rad_s", "4"}};
  for (const char* term :
       {"air_force_N_s_m", "gap_viscosity_Pa_s", "friction", "contact_radius_m",
        "rolling_friction_m", "pivoting_friction_m", "contour_friction_m", "spin_down_dry_rad_s2",
        "spin_down_viscous_1_s", "spin_down_quadratic_1_rad", "spin_down_imbalance_sin_rad_s2",
        "spin_down_imbalance_cos_rad_s2"})
    changes[std::string("model.") + term] = "2e-4";
  for (const char* slope : {"support.slope_x", "support.slope_y"}) changes[slope] = "0.01";
  if (model != std::string("top-euler")) {  // which refuses them
    changes["model.drag_transverse_N_m_s"] = "0.1";
    changes["model.drag_spin_N_m_s"] = "0.1";
    changes["model.drag_spin_dry_N_m"] = "0.1";
    changes["model.drag_spin_quadratic_N_m_s2"] = "0.1";
  }
  if (keys().contains("start.omega_s_rad_s")) changes.erase("start.w3_rad_s");  // the same rate
  for (const auto& [key, value] : changes) {
    Keys other = keys();
    other[key] = value;
    const data::Scene changed = scene_of(other, model);
    const std::vector<std::string> idle = idle_keys(changed);
    const bool is_idle = std::find(idle.begin(), idle.end(), key) != idle.end();
    EXPECT_EQ(is_idle, run_alike(plain, changed)) << key;
  }
}
INSTANTIATE_TEST_SUITE_P(Models, IdleKeys,
                         testing::Values(Motion{"rolling", disc_on_its_rim},
                                         Motion{"smooth", disc_on_its_rim},
                                         Motion{"sliding", disc_on_its_rim}, Motion{"top", top},
                                         Motion{"top-euler", top}, Motion{"puck", disc_on_its_face},
                                         Motion{"pivot", disc_on_a_pin},
                                         Motion{"free", disc_in_flight}));

TEST(IdleKeys, AreTheRatesThatABodyInFlightIsGivenTwice) {
  Keys keys = disc_in_flight();
  keys["start.w_body_rad_s"] = "[1, 2, 3]";
  const std::vector<std::string> expected{"start.w1_rad_s", "start.w2_rad_s",
                                          "start.omega_s_rad_s"};
  EXPECT_EQ(idle_keys(scene_of(keys, "free")), expected);
}

TEST(IdleKeys, AreASupportOfAnotherModelThanTheOneNamed) {
  using Names = std::vector<std::string>;
  const Keys pinned{{"support.kind", "\"pivot\""}, {"support.pivot_m", "[0, 0, 0]"}};
  EXPECT_EQ(idle_keys(scene_of(pinned, "rolling")), (Names{"support.kind", "support.pivot_m"}));
  EXPECT_EQ(idle_keys(scene_of(pinned, "top")), Names{});
  EXPECT_EQ(idle_keys(scene_of({{"support.kind", "\"flat\""}}, "sliding")), Names{"support.kind"});
  EXPECT_EQ(idle_keys(scene_of({{"support.kind", "\"flat\""}}, "puck")), Names{});
  EXPECT_EQ(idle_keys(scene_of({{"support.kind", "\"none\""}}, "top")), Names{"support.kind"});
}

// A file is shared by several models; what all of them know is never idle, nor what is not given.
TEST(IdleKeys, OfAnEmptySceneAreNone) {
  EXPECT_TRUE(idle_keys(scene_of({}, "rolling")).empty());
  EXPECT_TRUE(idle_keys(scene_of({{"start.psi_rad", "1"}}, "pivot")).empty());
}

}  // namespace
}  // namespace trochoid::model
