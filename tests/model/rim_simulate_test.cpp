#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "common.hpp"
#include "reference_cases.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/reference_case.hpp"
#include "trochoid/model/simulate.hpp"

namespace trochoid::model {
namespace {

/// Runs a scene on the thinned reference's own times, which are multiples of 1/rate.
struct Compared {
  Trajectory run;
  data::Table reference;
  [[nodiscard]] double error(const std::string& ours, const std::string& theirs) const {
    constexpr double kSameTime_s = 1e-9;
    const Eigen::VectorXd a = column(run, ours), b = reference.column(theirs);
    const Eigen::VectorXd t = reference.column("t"), mine = column(run, "t_s");
    double largest = 0.0;
    Eigen::Index row = 0;
    for (Eigen::Index n = 0; n < t.size(); ++n) {
      while (row < mine.size() && mine[row] < t[n] - kSameTime_s) ++row;
      if (row == mine.size()) return INFINITY;
      EXPECT_NEAR(mine[row], t[n], kSameTime_s);
      largest = std::max(largest, std::abs(a[row] - b[n]));
    }
    return largest;
  }
};
Compared compare(const std::string& name, double tolerance = 1e-13) {
  data::Scene scene = reference_scene(name);
  scene.run.tolerance = tolerance;
  return {simulate(scene), data::read_table(reference_path(name, ".csv"))};
}

struct ReferenceBounds {
  const char* name;
  double angle, length, energy;  ///< reached, with a margin of ten
};
class RimReference : public testing::TestWithParam<ReferenceBounds> {};

TEST_P(RimReference, IsReproducedInEveryColumn) {
  const Compared c = compare(GetParam().name);
  EXPECT_EQ(c.run.outcome, Outcome::reached_end);
  for (const char* name : {"phi", "theta", "psi"})
    EXPECT_LE(c.error(std::string(name) + "_rad", name), GetParam().angle) << name;
  for (const char* name : {"x", "y", "z"})
    EXPECT_LE(c.error(std::string(name) + "_m", name), GetParam().length) << name;
  EXPECT_LE(c.error("energy_J", "energy"), GetParam().energy);
  // Rates are up to 1e3 1/s times the angles they belong to; contact forces likewise.
  for (const char* name : {"w1", "w2", "w3", "dphi", "dpsi"})
    EXPECT_LE(c.error(std::string(name) + "_rad_s", name), 1e3 * GetParam().angle) << name;
  EXPECT_LE(c.error("normal_force_N", "N"), 1e3 * GetParam().angle);
  EXPECT_LE(c.error("force_x_N", "Fx"), 1e3 * GetParam().angle);
  EXPECT_LE(c.error("contact_y_m", "yc"), 1e3 * GetParam().length);
  EXPECT_LE(c.error("vx_m_s", "vx"), 1e3 * GetParam().length);
}
INSTANTIATE_TEST_SUITE_P(Rim, RimReference,
                         testing::Values(ReferenceBounds{"s05_smooth_disc", 3e-8, 1e-10, 1e-10},
                                         ReferenceBounds{"s06_roll_disc", 6e-11, 1e-11, 1e-13},
                                         ReferenceBounds{"s07_roll_hoop_thin", 2e-11, 1e-11, 1e-13},
                                         ReferenceBounds{"s08_slide_disc", 4e-11, 1e-11, 1e-13},
                                         ReferenceBounds{"s09_ring_retrograde_drag", 3e-11, 1e-11,
                                                         1e-13}));

// The reference states its own uncertainty: 3.9e-5 rad, 2.7e-6 m, 4.2e-5 s.
TEST(ExactCoulomb, FindsTheTwentyEventsOfTheReference) {
  constexpr double kAngle = 3.9e-5, kLength = 2.7e-6, kTime_s = 4.2e-5;
  const Compared c = compare("s10_stick_slip_event", 1e-12);
  EXPECT_LE(c.error("theta_rad", "theta"), kAngle);
  EXPECT_LE(c.error("x_m", "x"), kLength);
  EXPECT_LE(c.error("y_m", "y"), kLength);
  const double events_s[] = {
      0.04968661296613985, 0.3372374801141652, 0.6515495849987775, 0.9216421738468644,
      0.9917287011922116,  1.0321880788689135, 1.2172332516738837, 1.2991556517243925,
      1.392908068699665,   1.4205115434121411, 1.4426861280721055, 1.4721704764682857,
      1.5839656306387384,  1.663628837106431,  1.7525954409938493, 1.7810217875208518,
      1.794630440136598,   1.8337154734068428, 1.929468763874862};
  ASSERT_EQ(c.run.events.size(), std::size(events_s));
  for (std::size_t i = 0; i < std::size(events_s); ++i) {
    EXPECT_NEAR(c.run.events[i].t_s, events_s[i], kTime_s);
    EXPECT_EQ(c.run.events[i].name, i % 2 == 0 ? "stick" : "slip");
  }
}

// At its own tolerance a run's estimate must not be below the error it has.
TEST(RimSimulation, EstimatesItsErrorHonestly) {
  for (const char* name : {"s06_roll_disc", "s09_ring_retrograde_drag", "s08_slide_disc"}) {
    for (const double tolerance : {1e-6, 1e-9}) {
      const Compared c = compare(name, tolerance);
      EXPECT_GE(1.5 * c.run.error_estimate_m, c.error("x_m", "x")) << name << " " << tolerance;
      EXPECT_LE(c.run.error_estimate_m, 1e5 * tolerance);
    }
  }
}

TEST(RimSimulation, AgreesBetweenItsIntegrators) {
  for (const char* name : {"s05_smooth_disc", "s06_roll_disc", "s08_slide_disc"}) {
    data::Scene scene = reference_scene(name);
    scene.run.until_s = 0.5;
    scene.run.tolerance = 1e-11;
    const Trajectory ours = simulate(scene);
    for (const std::string integrator : {"cvode-bdf", "cvode-adams", "arkode"}) {
      // Explicit Runge-Kutta of ARKODE gives up on the stiff law at this tolerance, and says so.
      if (integrator == "arkode" && std::string(name) == "s08_slide_disc") continue;
      scene.run.integrator = integrator;
      const Trajectory theirs = simulate(scene);
      ASSERT_EQ(theirs.values.rows(), ours.values.rows()) << integrator;
      EXPECT_LE((column(theirs, "theta_rad") - column(ours, "theta_rad")).cwiseAbs().maxCoeff(),
                2e-7)
          << name << " " << integrator;
    }
  }
}

// A start that touches with a face already never crosses that surface again.
TEST(RimSimulation, OfABodyThatLiesFlatEndsAtOnceWithAnyIntegrator) {
  data::Scene scene = reference_scene("s05_smooth_disc");
  scene.start.theta_rad = 0.005;
  for (const char* integrator : {"dop853", "cvode-bdf", "cvode-adams", "arkode"}) {
    scene.run.integrator = integrator;
    const Trajectory run = simulate(scene);
    EXPECT_EQ(run.outcome, Outcome::flat) << integrator;
    EXPECT_EQ(run.end_s, 0.0) << integrator;
  }
}

TEST(RimSimulation, ShorterThanOneIntervalHasItsStart) {
  data::Scene scene = reference_scene("s06_roll_disc");
  scene.run.until_s = 0.5 / scene.run.rate_hz;
  const Trajectory run = simulate(scene);
  EXPECT_EQ(run.outcome, Outcome::reached_end);
  EXPECT_EQ(run.end_s, 0.0);
  ASSERT_EQ(run.values.rows(), 1);
  EXPECT_EQ(column(run, "theta_rad")[0], scene.start.theta_rad);
}

// Which rim touches decides how the contact moves; exactly on edge that is the one it falls on.
TEST(RimSimulation, OfABodyOnEdgeBeginsWithTheVelocityItIsGiven) {
  data::Scene scene = reference_scene("s08_slide_disc");
  scene.start = {};
  scene.start.theta_rad = M_PI / 2.0;
  scene.start.w2_rad_s = 20.0;
  scene.start.vx_m_s = 0.1;
  scene.start.vy_m_s = 0.0;
  scene.run.until_s = 0.01;
  constexpr double kRounding_m_s = 1e-12;  // of speeds below 1 m/s, there and back to the contact
  for (const double falls_rad_s : {0.5, -0.5}) {
    scene.start.w1_rad_s = falls_rad_s;
    const Trajectory run = simulate(scene);
    EXPECT_NEAR(column(run, "vx_m_s")[0], 0.1, kRounding_m_s) << falls_rad_s;
    EXPECT_NEAR(column(run, "vy_m_s")[0], 0.0, kRounding_m_s) << falls_rad_s;
  }
}

// Implicit steps damp what grows slowly, a top that falls asleep as well: they are for what is
// stiff.
TEST(RimSimulation, TakesImplicitStepsWhereFrictionIsStiffAndRefusesThemElsewhere) {
  data::Scene scene = reference_scene("s08_slide_disc");
  scene.run.until_s = 0.1;
  scene.model.slip_regularisation_m_s = 1e-5;
  const Trajectory run = simulate(scene);
  EXPECT_EQ(run.integrator, "radau");
  EXPECT_LE(run.error_estimate_rad, 1e-8);
  scene.model.slip_regularisation_m_s = 1.0;
  EXPECT_EQ(simulate(scene).integrator, "dop853");
  for (const char* name : {"s10_stick_slip_event", "s06_roll_disc", "s05_smooth_disc",
                           "s03_top_thesis_base", "s02_free_symmetric"}) {
    data::Scene other = reference_scene(name);
    other.run.integrator = "radau";
    try {
      (void)simulate(other);
      ADD_FAILURE() << name;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find("run.integrator = \"radau\""), std::string::npos)
          << error.what();
    }
  }
}

// With 0 the contact couples are 0/0 where a rate is zero.
TEST(RimSimulation, RefusesCouplesWithoutRegularisation) {
  data::Scene scene = reference_scene("s06_roll_disc");
  scene.model.pivoting_friction_m = 1e-4;
  scene.model.couple_regularisation_rad_s = 0.0;
  EXPECT_THROW(static_cast<void>(simulate(scene)), InputError);
}

TEST(RimSimulation, LeavesForceAndEnergyOutWithoutAMass) {
  data::Scene scene = reference_scene("s06_roll_disc");
  const Trajectory weighed = simulate(scene);
  scene.body->mass_kg.reset();
  scene.body->I_kg_m2.reset();
  scene.body->Is_kg_m2.reset();
  const Trajectory unknown = simulate(scene);
  for (const std::string& name : unknown.columns) {
    EXPECT_NE(name, "energy_J");
    EXPECT_NE(name, "normal_force_N");
  }
  constexpr double kAddedUp_m = 1e-9;  // tolerance 1e-10 of another scaling of the same equations
  EXPECT_LE((column(weighed, "x_m") - column(unknown, "x_m")).cwiseAbs().maxCoeff(), kAddedUp_m);
}

// A thin disc that turns too slowly to stand on edge: what tips it over is the error of the
// integration. What is shown of a loose run is what a fine one shows too, and no more.
TEST(RimExtreme, ABodyThatTipsOverByTheErrorOfItsRunEndsWhereItDoes) {
  data::Scene scene;
  data::Body& body = scene.body.emplace();
  body.radius_m = 0.03;
  body.mass_kg = 0.05;
  scene.model.name = "rolling";
  scene.start.theta_rad = 0.5 * M_PI;
  scene.start.w2_rad_s = 3.0;
  scene.start.w3_rad_s = 0.5;
  scene.run.until_s = 6.0;
  scene.run.tolerance = 1e-6;
  const Trajectory loose = simulate(scene);
  scene.run.tolerance = 1e-13;
  const Trajectory fine = simulate(scene);
  EXPECT_EQ(loose.outcome, Outcome::diverged);
  ASSERT_GT(loose.values.rows(), 10);
  ASSERT_GT(fine.values.rows(), loose.values.rows());
  const Eigen::VectorXd off =
      column(loose, "theta_rad") - column(fine, "theta_rad").head(loose.values.rows());
  EXPECT_LT(off.cwiseAbs().maxCoeff(), 0.06);
}

// A thick disc that rolls almost upright rocks from rim to rim, by less each time, and stands on
// its wall after a finite time and impacts without number.
TEST(RimExtreme, ABodyThatSettlesOnItsWallEndsThereAfterAFewHundredImpacts) {
  data::Scene scene;
  data::Body& body = scene.body.emplace();
  body.radius_m = 0.03;
  body.thickness_m = 0.008;
  body.mass_kg = 0.06;
  scene.model.friction = 0.3;
  scene.start.theta_rad = 1.55;
  scene.start.w3_rad_s = 20.0;
  scene.run.until_s = 2.0;
  scene.run.rim_switch = "impact";
  for (const char* law : {"sliding", "rolling"}) {
    scene.model.name = law;
    if (scene.model.name == "rolling") scene.model.pivoting_friction_m = 1e-4;
    const Trajectory run = simulate(scene);
    EXPECT_EQ(run.outcome, Outcome::rim_switch) << law;
    EXPECT_LT(run.events.size(), 600u) << law;
    EXPECT_GT(run.end_s, 1.4) << law;
    EXPECT_NEAR(column(run, "theta_rad").tail(1)[0], 0.5 * M_PI, 1e-3) << law;
  }
}

}  // namespace
}  // namespace trochoid::model
