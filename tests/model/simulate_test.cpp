#include "trochoid/model/simulate.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "common.hpp"
#include "reference_cases.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::model {
namespace {

/// A run of the reference's scene on its (thinned) grid.
Trajectory rerun(Reference& expected, double tolerance, const std::string& integrator = "auto") {
  const Eigen::VectorXd t_s = expected.column("t");
  data::Scene& scene = expected.posed.scene;
  scene.run.rate_hz = 1.0 / (t_s[1] - t_s[0]);
  scene.run.tolerance = tolerance;
  scene.run.integrator = integrator;
  return simulate(scene);
}

double largest_difference(const Trajectory& run, const std::string& ours, const Reference& expected,
                          const char* theirs) {
  const Eigen::VectorXd a = column(run, ours), b = expected.column(theirs);
  EXPECT_EQ(a.size(), b.size());
  return (a - b).cwiseAbs().maxCoeff();
}

struct SameRun {
  const char* name;
  double angle_rad, path_m;  // the reference's own uncertainty, rounded up
};
class FollowsReference : public testing::TestWithParam<SameRun> {};

TEST_P(FollowsReference, InAnglesRatesPathAndEnergy) {
  Reference expected = reference(GetParam().name);
  const Trajectory run = rerun(expected, 1e-13);
  EXPECT_EQ(run.outcome, Outcome::reached_end);
  const double angle = GetParam().angle_rad;
  EXPECT_LT(largest_difference(run, "theta_rad", expected, "theta"), angle);
  EXPECT_LT(largest_difference(run, "phi_rad", expected, "phi"), angle);
  EXPECT_LT(largest_difference(run, "psi_rad", expected, "psi"), 10 * angle);
  EXPECT_LT(largest_difference(run, "dphi_rad_s", expected, "dphi"), 100 * angle);
  EXPECT_LT(largest_difference(run, "dtheta_rad_s", expected, "dtheta"), 100 * angle);
  EXPECT_LT(largest_difference(run, "dpsi_rad_s", expected, "dpsi"), 100 * angle);
  EXPECT_LE(largest_difference(run, "x_m", expected, "x"), GetParam().path_m);
  EXPECT_LE(largest_difference(run, "y_m", expected, "y"), GetParam().path_m);
  EXPECT_LE(largest_difference(run, "z_m", expected, "z"), GetParam().path_m);
  const Eigen::VectorXd energy = expected.column("energy");
  EXPECT_LT(largest_difference(run, "energy_J", expected, "energy"), 1e-10 * energy.maxCoeff());
}
INSTANTIATE_TEST_SUITE_P(Simulate, FollowsReference,
                         testing::Values(SameRun{"s01_free_thesis", 1e-10, 0.0},
                                         SameRun{"s02_free_symmetric", 1e-10, 0.0},
                                         SameRun{"s03_top_thesis_base", 2e-10, 2e-11},
                                         SameRun{"s04_top_loops", 2e-10, 2e-11},
                                         SameRun{"s11_top_drag", 2e-10, 2e-11}),
                         [](const auto& test) { return std::string(test.param.name); });

// Independent integrators through the same interface; 1e-11 asked, multistep methods deliver a few
// thousand times that over 60 s (BDF, of order 5, most).
class EveryIntegrator : public testing::TestWithParam<const char*> {};
TEST_P(EveryIntegrator, GivesTheSameRun) {
  constexpr double kAllowed = 3e-7;
  for (const char* name : {"s01_free_thesis", "s03_top_thesis_base", "s11_top_drag"}) {
    Reference expected = reference(name);
    const Trajectory run = rerun(expected, 1e-11, GetParam());
    EXPECT_EQ(run.integrator, GetParam());
    EXPECT_LT(largest_difference(run, "theta_rad", expected, "theta"), kAllowed) << name;
    EXPECT_LT(largest_difference(run, "phi_rad", expected, "phi"), kAllowed) << name;
    EXPECT_LT(run.error_estimate_rad, kAllowed) << name;
  }
}
INSTANTIATE_TEST_SUITE_P(Simulate, EveryIntegrator,
                         testing::Values("taylor", "dop853", "cvode-adams", "cvode-bdf", "arkode"));

data::Scene hanging_top() {
  data::Scene scene;
  scene.model.name = "top";
  data::Body& body = scene.body.emplace();
  body.kind = data::BodyKind::top;
  body.mass_kg = 0.1;
  body.I_kg_m2 = 1e-3;
  body.Is_kg_m2 = 1.5e-4;
  body.l_m = 0.03;
  scene.start.theta_rad = 3.1415;
  scene.start.dtheta_rad_s = 0.3;
  scene.start.omega_s_rad_s = 5.0;
  scene.run.until_s = 2.0;
  return scene;
}

// phi + psi is singular where a top hangs straight down, and a step may pass over that unseen.
TEST(Simulate, EveryIntegratorFollowsTheSpinOfATopThatHangs) {
  data::Scene scene = hanging_top();
  const Eigen::VectorXd psi = column(simulate(scene), "psi_rad");
  for (const char* integrator : {"cvode-adams", "cvode-bdf", "arkode"}) {
    scene.run.integrator = integrator;
    const Trajectory run = simulate(scene);
    ASSERT_EQ(run.outcome, Outcome::reached_end) << integrator;
    constexpr double kAllowed_rad = 1e-5;  // of 1e-10 beside the pole, where phi and psi turn fast
    const Eigen::VectorXd off_turns = (column(run, "psi_rad") - psi) / (2.0 * M_PI);
    EXPECT_LT((off_turns.array() - off_turns.array().round()).abs().maxCoeff(), kAllowed_rad)
        << integrator;
  }
}

TEST(Simulate, SundialsRefusesATopThatComesNearBothPoles) {
  data::Scene scene = hanging_top();
  scene.start.theta_rad = 0.01;
  scene.start.omega_s_rad_s = 0.5;
  EXPECT_EQ(simulate(scene).outcome, Outcome::reached_end);
  scene.run.integrator = "arkode";
  EXPECT_THROW(static_cast<void>(simulate(scene)), NotOffered);
}

// The estimate is what people will believe: it must not promise more than the run keeps, nor be
// far from it.
TEST(Simulate, ErrorEstimateCoversTheTrueError) {
  for (const double tolerance : {1e-5, 1e-7, 1e-9}) {
    Reference expected = reference("s03_top_thesis_base");
    const Trajectory run = rerun(expected, tolerance);
    const double error = std::max(largest_difference(run, "x_m", expected, "x"),
                                  largest_difference(run, "y_m", expected, "y"));
    EXPECT_GT(3.0 * run.error_estimate_m, error) << tolerance;
    EXPECT_LT(run.error_estimate_m, 100.0 * error + 1e-12) << tolerance;
  }
}

TEST(Simulate, StatesNoErrorInMetresWhereTheCentreOfMassStaysPut) {
  Reference expected = reference("s01_free_thesis");
  const Trajectory run = rerun(expected, 1e-7);
  EXPECT_TRUE(std::isnan(run.error_estimate_m));
  EXPECT_GT(run.error_estimate_rad, 0.0);
}

TEST(Simulate, TheThesisFormGivesTheSameMotion) {
  Reference expected = reference("s04_top_loops");
  expected.posed.scene.model.name = "top-euler";
  const Trajectory run = rerun(expected, 1e-12);
  // A hundred local errors of 1e-12; near the pole, where Euler angles are singular, psi turns
  // fast.
  constexpr double kPath_m = 1e-10, kSpin_rad = 1e-8;
  EXPECT_LT(largest_difference(run, "x_m", expected, "x"), kPath_m);
  EXPECT_LT(largest_difference(run, "psi_rad", expected, "psi"), kSpin_rad);
}

TEST(Simulate, BeginsATopWithTheSpinItIsGivenBesideARateOfTheNodeFrame) {
  data::Scene scene = reference("s03_top_thesis_base").posed.scene;
  scene.start = {};
  scene.start.theta_rad = 1.0;
  scene.start.w2_rad_s = 2.0;
  scene.start.dpsi_rad_s = 30.0;
  scene.run.until_s = 0.1;
  const Trajectory run = simulate(scene);
  constexpr double kRounding_rad_s = 1e-10;  // of rates of some 30 rad/s, to axis and back
  EXPECT_NEAR(column(run, "dpsi_rad_s")[0], 30.0, kRounding_rad_s);
  EXPECT_NEAR(column(run, "dphi_rad_s")[0], 2.0 / std::sin(1.0), kRounding_rad_s);
}

TEST(Simulate, NamesTheFieldThatIsOutOfRange) {
  const auto refusal = [](const data::Scene& scene) -> std::string {
    try {
      (void)simulate(scene);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  data::Scene top = reference("s11_top_drag").posed.scene;
  top.model.drag_spin_N_m_s = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(refusal(top).find("model.drag_spin_N_m_s = nan"), std::string::npos) << refusal(top);
  data::Scene free = reference("s01_free_thesis").posed.scene;
  free.start.w_body_rad_s.reset();
  free.start.theta_rad = 0.0;
  free.start.w2_rad_s = 1.0;
  EXPECT_NE(refusal(free).find("give w3_rad_s"), std::string::npos) << refusal(free);
  data::Scene disc = reference("s06_roll_disc").posed.scene;
  disc.model.air_linear_N_m_s = Eigen::Vector3d(0.0, 1e-6, 0.0);
  EXPECT_NE(refusal(disc).find("model.air_linear_N_m_s"), std::string::npos) << refusal(disc);
}

TEST(Simulate, NamesWhatTheSceneLacks) {
  data::Scene scene = reference("s03_top_thesis_base").posed.scene;
  scene.body->mass_kg.reset();
  EXPECT_THROW((void)simulate(scene), InputError);
  scene = reference("s03_top_thesis_base").posed.scene;
  scene.run.integrator = "euler";
  EXPECT_THROW((void)simulate(scene), InputError);
  scene = reference("s01_free_thesis").posed.scene;
  scene.start.moments_kg_m2 = Eigen::Vector3d(1.0, 1.0, 3.0);  // no body has these
  EXPECT_THROW((void)simulate(scene), InputError);
}

TEST(Start, OfOneRateUnderTwoNamesIsRefusedByEveryModel) {
  data::Scene scene;
  data::Body& body = scene.body.emplace();
  body.radius_m = 0.03;
  body.mass_kg = 0.05;
  body.l_m = 0.1;
  scene.model.friction = 0.2;
  scene.start.theta_rad = 0.8;
  scene.start.w3_rad_s = 5.0;
  for (const char* name : {"free", "top", "rolling", "smooth", "sliding", "puck", "pivot"}) {
    scene.model.name = name;
    scene.start.dpsi_rad_s.reset();
    EXPECT_NO_THROW((void)simulate(scene)) << name;
    scene.start.dpsi_rad_s = 5.0;
    EXPECT_THROW((void)simulate(scene), InputError) << name;
    if (scene.model.name == "free") continue;  // it predicts no path
    EXPECT_THROW((void)make_predictor(scene), InputError) << name;
  }
}

}  // namespace
}  // namespace trochoid::model
