#include "common/fitted_scene.hpp"

#include <gtest/gtest.h>

#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/table.hpp"
#include "trochoid/model/predictor.hpp"
#include "trochoid/model/simulate.hpp"

// A fit's motion run on its own must be what the fit itself predicted: two ways through the models.
namespace trochoid::tools {
namespace {

constexpr double kApart_m = 1e-8;  // both runs integrate to 1e-10

/// A fit at the model's own values for the scene, with the given changes.
data::Fit fit_of(const std::string& toml, const std::map<std::string, double>& changed) {
  const data::Scene scene = data::parse_scene(toml, "test");
  const auto predictor = model::make_predictor(scene);
  data::Fit fit;
  fit.model = predictor->model_name();
  fit.scene_toml = toml;
  fit.time_origin_s = 0.5;
  fit.arcs.push_back({.track = 0, .object = 0, .from_s = 0.5, .to_s = 1.5, .samples = 101});
  for (const model::ParameterInfo& info : predictor->parameters()) {
    const auto other = changed.find(info.name);
    fit.parameters.push_back({.name = info.name,
                              .value = other != changed.end() ? other->second : info.value,
                              .unit = info.unit,
                              .note = {}});
  }
  return fit;
}

void expect_same_path(const data::Fit& fit) {
  data::Scene scene = fitted_scene(fit, 0);
  scene.run.rate_hz = 100.0;
  const model::Trajectory run = model::simulate(scene);
  ASSERT_EQ(run.outcome, model::Outcome::reached_end);
  const auto predictor = model::make_predictor(data::parse_scene(fit.scene_toml, "test"));
  Eigen::VectorXd values(static_cast<Eigen::Index>(fit.parameters.size()));
  for (std::size_t i = 0; i < fit.parameters.size(); ++i)
    values[static_cast<Eigen::Index>(i)] = fit.parameters[i].value;
  const data::Table table{.header = {}, .columns = run.columns, .values = run.values};
  const Eigen::VectorXd t_s = table.column("t_s"), x = table.column("x_m"), y = table.column("y_m");
  model::PredictRequest request;
  request.t_s = {t_s.data(), static_cast<std::size_t>(t_s.size())};
  const model::Prediction expected = predictor->predict(values, request);
  ASSERT_EQ(t_s.size(), 101);
  for (Eigen::Index i = 0; i < t_s.size(); ++i) {
    EXPECT_NEAR(x[i], expected.values[2 * i], kApart_m) << "at " << t_s[i] << " s";
    EXPECT_NEAR(y[i], expected.values[2 * i + 1], kApart_m) << "at " << t_s[i] << " s";
  }
}

TEST(FittedScene, RunsARollingRingAsTheFitPredictsIt) {
  expect_same_path(fit_of(R"(
[body]
kind = "ring"
radius_m = 0.03
inner_radius_m = 0.027
thickness_m = 0.008
mass_kg = 0.0337
[model]
name = "rolling"
air_linear_N_m_s = [2e-6, 2e-6, 1e-5]
rolling_friction_m = 1e-5
[start]
theta_rad = 1.2
w2_rad_s = 20.0
w3_rad_s = 4.0
)",
                          {{"theta_rad", 1.1},
                           {"w3_rad_s", 5.0},
                           {"x_m", 0.01},
                           {"air_linear_N_m_s[1]", 4e-6},
                           {"air_linear_N_m_s[3]", 2e-5},
                           {"rolling_friction_m", 3e-5}}));
}

TEST(FittedScene, RunsATopOfUnknownMassFromItsGroupsAlone) {
  expect_same_path(fit_of(R"(
[body]
kind = "top"
mass_kg = 0.1
I_kg_m2 = 1e-3
Is_kg_m2 = 5e-4
l_m = 0.05
[model]
name = "top"
[start]
theta_rad = 0.5
omega_s_rad_s = 60.0
)",
                          {{"a_1_s2", 120.0},
                           {"b_1_s", 25.0},
                           {"l_m", 0.04},
                           {"theta_rad", 0.7},
                           {"dphi_rad_s", 2.0},
                           {"pivot_x_m", 0.003}}));
}

// Whose moments the shape would give, about the centre.
TEST(FittedScene, RunsADiscOnAnAxleByItsGroupsNotItsShape) {
  expect_same_path(fit_of(R"(
[body]
kind = "disc"
radius_m = 0.03
thickness_m = 0.008
mass_kg = 0.06
l_m = 0.045
[support]
kind = "pivot"
pivot_m = [0.004, -0.003, 0.025]
[model]
name = "top"
drag_spin_N_m_s = 1e-7
[start]
theta_rad = 0.5
omega_s_rad_s = 150.0
)",
                          {{"a_1_s2", 190.0},
                           {"b_1_s", 31.0},
                           {"l_m", 0.044},
                           {"gamma3_1_s", 0.02},
                           {"omega_s_rad_s", 155.0},
                           {"dphi_rad_s", -4.0}}));
}

TEST(FittedScene, RunsAPuckOnTheContactThatWasFitted) {
  expect_same_path(fit_of(R"(
[body]
kind = "disc"
radius_m = 0.02
thickness_m = 0.006
[support]
kind = "flat"
[model]
name = "puck"
friction = 0.1
[start]
vx_m_s = 1.2
w3_rad_s = 20.0
)",
                          {{"contact_radius_m", 0.012}, {"friction", 0.08}}));
}

// After an impact a puck went on with the spin that its mark had shown before.
TEST(FittedScene, HasOfALaterArcNoStateThatWasFoundOfTheFirstAlone) {
  data::Fit fit = fit_of(
      "[body]\nkind = \"disc\"\nradius_m = 0.03\nmass_kg = 0.05\n[support]\nkind = \"flat\"\n"
      "[model]\nname = \"puck\"\nfriction = 0.2\n",
      {{"w3_rad_s", 40.0}, {"vx_m_s", 1.2}});
  fit.arcs.push_back({.track = 0, .object = 0, .from_s = 1.6, .to_s = 2.5, .samples = 91});
  fit.parameters.push_back({.name = "vx_m_s@1", .value = -0.4, .unit = "m/s", .note = {}});
  const data::Scene later = fitted_scene(fit, 1);
  EXPECT_EQ(later.start.vx_m_s, -0.4);
  EXPECT_EQ(later.start.w3_rad_s.value_or(0.0), 0.0);
  EXPECT_EQ(later.model.friction, 0.2);
}

// Metres that went by the body's radius are as much off as that is.
TEST(FittedScene, HasABodyAsLargeAsTheFittedScaleMakesIt) {
  data::Fit fit = fit_of(
      "[body]\nkind = \"disc\"\nradius_m = 0.03\nmass_kg = 0.05\n[model]\nname = \"rolling\"\n"
      "[start]\ntheta_rad = 1.2\n[fit]\nprior = { radius_m = [0.03, 0.0003] }\n",
      {});
  EXPECT_DOUBLE_EQ(fitted_scene(fit, 0).body->radius_m, 0.03);
  fit.parameters.push_back({.name = "scale", .value = 1.01, .unit = "1", .note = {}});
  EXPECT_DOUBLE_EQ(fitted_scene(fit, 0).body->radius_m, 0.03 / 1.01);
}

TEST(FittedScene, SaysHowManyArcsThereAre) {
  try {
    (void)fitted_scene(data::Fit{}, 0);
    FAIL() << "no error";
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), "the fit has 0 arcs, counted from 0: no arc 0");
  }
}

}  // namespace
}  // namespace trochoid::tools
