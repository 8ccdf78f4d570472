#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "common.hpp"
#include "reference_cases.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/reference_case.hpp"
#include "trochoid/model/simulate.hpp"

// A floor that rises by slope_x and slope_y per length (rolling.md, (13)).
namespace trochoid::model {
namespace {

constexpr double kGravity_m_s2 = 9.81;

data::Scene on_slope(data::Scene scene, double x, double y) {
  scene.support.slope_x = x;
  scene.support.slope_y = y;
  return scene;
}

double largest_value(const Eigen::VectorXd& difference) {
  return difference.cwiseAbs().maxCoeff();
}

/// A thin disc, on edge and at rest; it rolls along x.
data::Scene upright_disc(const char* model) {
  data::Scene scene;
  scene.body.emplace();
  scene.body->radius_m = 0.03;
  scene.body->mass_kg = 0.05;
  scene.model.name = model;
  scene.start.theta_rad = 0.5 * data::kPi;
  scene.run.until_s = 0.5;
  scene.run.tolerance = 1e-12;
  return scene;
}

// a = g slope/(1 + C/(m R^2)), C = m R^2/2.
TEST(Slope, AnUprightDiscRollsDownWithTwoThirdsOfTheWeightsPartAlongIt) {
  constexpr double kSlope = 0.02;
  const Trajectory run = simulate(on_slope(upright_disc("rolling"), kSlope, 0.0));
  const Eigen::ArrayXd t_s = column(run, "t_s").array();
  const Eigen::VectorXd expected_m = -0.5 * kGravity_m_s2 * kSlope / 1.5 * t_s.square();
  constexpr double kRounding_m = 1e-12;
  EXPECT_LE(largest_value(column(run, "x_m") - expected_m), kRounding_m);
  EXPECT_LE(largest_value(column(run, "y_m")), kRounding_m);
  // The third that is missing is what the floor holds it back by.
  const Eigen::VectorXd force_N = column(run, "force_x_N");
  EXPECT_NEAR(force_N[0], 0.05 * kGravity_m_s2 * kSlope / 3.0, 1e-12);
}

// Nothing but the weight has a part along a floor without friction.
TEST(Slope, ABodyOnASmoothFloorFallsAlongItAndTurnsAsOnALevelOne) {
  data::Scene scene = reference_scene("s05_smooth_disc");
  scene.run.tolerance = 1e-12;
  const Trajectory level = simulate(scene), sloped = simulate(on_slope(scene, 0.01, -0.03));
  ASSERT_EQ(level.values.rows(), sloped.values.rows());
  const Eigen::VectorXd half_t2 = 0.5 * column(level, "t_s").array().square().matrix();
  constexpr double kTolerance = 1e-8;  // as of the nutation on a level floor
  const auto fallen_m = [&](const char* name) {
    return Eigen::VectorXd(column(sloped, name) - column(level, name));
  };
  EXPECT_LE(largest_value(fallen_m("x_m") + kGravity_m_s2 * 0.01 * half_t2), kTolerance);
  EXPECT_LE(largest_value(fallen_m("y_m") - kGravity_m_s2 * 0.03 * half_t2), kTolerance);
  EXPECT_LE(largest_value(fallen_m("theta_rad")), kTolerance);
}

TEST(Slope, TheEnergyWithTheHeightOfTheFloorIsKeptFromAnyStart) {
  std::mt19937 draw(11);
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  constexpr double kTolerance = 1e-9;  // of tolerance 1e-12, over a second of fast turns
  for (const char* model : {"rolling", "smooth"})
    for (int i = 0; i < 20; ++i) {
      data::Scene scene = on_slope(upright_disc(model), 0.1 * u(draw), 0.1 * u(draw));
      scene.body->thickness_m = 0.004;
      scene.start.theta_rad = 0.9 + 0.5 * u(draw);
      scene.start.phi_rad = 3.0 * u(draw);
      scene.start.w2_rad_s = 10.0 * u(draw);
      scene.start.w3_rad_s = 10.0 * u(draw);
      scene.run.until_s = 1.0;
      const Eigen::VectorXd energy_J = column(simulate(scene), "energy_J");
      ASSERT_GE(energy_J.size(), 2) << model << " " << i;
      EXPECT_LE(energy_J.maxCoeff() - energy_J.minCoeff(), kTolerance) << model << " " << i;
    }
}

TEST(Slope, TurningFloorAndStartTurnsThePath) {
  constexpr double kTurn_rad = 0.7, kSlope = 0.01, kRounding_m = 1e-9;
  for (const char* name : {"s06_roll_disc", "s08_slide_disc"}) {
    data::Scene scene = reference_scene(name);
    scene.run.until_s = 0.5;
    scene.run.tolerance = 1e-12;
    scene.start.x_m = scene.start.y_m = 0.0;
    scene.start.vx_m_s.reset();  // as rolling would have it
    scene.start.vy_m_s.reset();
    const Trajectory run = simulate(on_slope(scene, kSlope, 0.0));
    scene.start.phi_rad = scene.start.phi_rad.value_or(0.0) + kTurn_rad;
    const double c = std::cos(kTurn_rad), s = std::sin(kTurn_rad);
    const Trajectory turned = simulate(on_slope(scene, kSlope * c, kSlope * s));
    const Eigen::VectorXd x = column(run, "x_m"), y = column(run, "y_m");
    EXPECT_LE(largest_value(column(turned, "x_m") - (c * x - s * y)), kRounding_m) << name;
    EXPECT_LE(largest_value(column(turned, "y_m") - (s * x + c * y)), kRounding_m) << name;
  }
}

TEST(Slope, ABodyThatAnyFrictionHoldsRollsDownAsWithoutAskingForIt) {
  data::Scene scene = on_slope(reference_scene("s06_roll_disc"), 0.01, 0.02);
  const Trajectory rolling = simulate(scene);
  scene.model.name = "sliding";
  scene.model.friction = 1e3;
  const Trajectory sliding = simulate(scene);
  constexpr double kRounding_m = 1e-12;
  EXPECT_LE(largest_value(column(rolling, "x_m") - column(sliding, "x_m")), kRounding_m);
}

TEST(Slope, AnotherIntegratorFindsTheSamePath) {
  constexpr double kTolerance_m = 1e-7;
  for (const char* name : {"s06_roll_disc", "s08_slide_disc"}) {
    data::Scene scene = on_slope(reference_scene(name), 0.01, 0.02);
    scene.run.until_s = 0.5;
    const Trajectory ours = simulate(scene);
    scene.run.integrator = "cvode-adams";
    const Trajectory other = simulate(scene);
    EXPECT_LE(largest_value(column(ours, "x_m") - column(other, "x_m")), kTolerance_m) << name;
  }
}

TEST(Slope, AFloorSaidToBeLevelIsOne) {
  constexpr double kRounding = 1e-13;
  for (const char* name : {"s05_smooth_disc", "s06_roll_disc", "s08_slide_disc"}) {
    data::Scene scene = reference_scene(name);
    scene.run.until_s = 0.1;
    const Trajectory absent = simulate(scene), level = simulate(on_slope(scene, 0.0, 0.0));
    EXPECT_LE(largest_value((absent.values - level.values).reshaped()), kRounding) << name;
  }
}

/// A puck that does not spin moves straight along the slope.
TEST(Slope, APuckIsBrakedByFrictionAndSlopeTogether) {
  constexpr double kFriction = 0.2, kSlope = 0.05, kSpeed_m_s = 1.0;
  data::Scene scene = upright_disc("puck");
  scene.model.friction = kFriction;
  scene.start.vx_m_s = kSpeed_m_s;
  scene.run.until_s = 2.0;
  const Trajectory run = simulate(on_slope(scene, kSlope, 0.0));
  const double brake_m_s2 = kGravity_m_s2 * (kFriction + kSlope);
  constexpr double kTolerance = 1e-9;
  ASSERT_EQ(run.outcome, Outcome::at_rest);
  EXPECT_NEAR(run.events.at(0).t_s, kSpeed_m_s / brake_m_s2, kTolerance);
  EXPECT_NEAR(column(run, "x_m").tail(1)[0], 0.5 * kSpeed_m_s * kSpeed_m_s / brake_m_s2,
              kTolerance);
  EXPECT_NEAR(column(run, "force_x_N")[0], -0.05 * kGravity_m_s2 * kFriction, kTolerance);
  // Friction alone takes energy.
  const Eigen::VectorXd energy_J = column(run, "energy_J");
  EXPECT_NEAR(energy_J[0] - energy_J.tail(1)[0],
              0.05 * kGravity_m_s2 * kFriction * column(run, "x_m").tail(1)[0], kTolerance);
}

TEST(Slope, ASteepFloorIsRefusedByName) {
  EXPECT_THROW((void)simulate(on_slope(upright_disc("rolling"), 0.3, 0.0)), InputError);
  EXPECT_THROW((void)simulate(on_slope(upright_disc("rolling"), 0.0, std::nan(""))), InputError);
}

}  // namespace
}  // namespace trochoid::model
