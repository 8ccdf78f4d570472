#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "common.hpp"
#include "reference_cases.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/reference_case.hpp"
#include "trochoid/model/simulate.hpp"

// What the contact models must do whatever the numbers: limits, closed forms, invariants, named
// ends.
namespace trochoid::model {
namespace {

double largest_difference(const Trajectory& a, const Trajectory& b, const std::string& name) {
  return (column(a, name) - column(b, name)).cwiseAbs().maxCoeff();
}

/// A disc of the given thickness on the floor, 37.5 mm radius, 60 g.
data::Scene disc_scene(double thickness_m) {
  data::Scene scene;
  scene.body.emplace();
  scene.body->radius_m = 0.0375;
  scene.body->thickness_m = thickness_m;
  scene.body->mass_kg = 0.06;
  scene.run.tolerance = 1e-12;
  return scene;
}

TEST(ContactLimits, SlidingWithGreatFrictionIsRolling) {
  data::Scene scene = reference_scene("s06_roll_disc");
  const Trajectory rolling = simulate(scene);
  scene.model.name = "sliding";
  scene.model.friction = 1e3;
  const Trajectory sliding = simulate(scene);
  EXPECT_TRUE(sliding.events.empty());
  constexpr double kRounding = 1e-12;  // a body that sticks is integrated as one that rolls
  EXPECT_LE(largest_difference(rolling, sliding, "theta_rad"), kRounding);
  EXPECT_LE(largest_difference(rolling, sliding, "x_m"), kRounding);
}

TEST(ContactLimits, SlidingWithoutFrictionIsTheSmoothFloor) {
  data::Scene scene = reference_scene("s05_smooth_disc");
  scene.run.tolerance = 1e-12;
  const Trajectory smooth = simulate(scene);
  scene.model.name = "sliding";
  scene.model.slip_regularisation_m_s = 1e-3;
  scene.model.friction = 1e-13;  // 0 itself is taken for the smooth floor
  const Trajectory sliding = simulate(scene);
  // Tolerance 1e-12 on the fast nutation of the tilt; the path feels the friction alone.
  constexpr double kTilt_rad = 1e-8, kPath_m = 1e-11;
  EXPECT_LE(largest_difference(smooth, sliding, "theta_rad"), kTilt_rad);
  EXPECT_LE(largest_difference(smooth, sliding, "x_m"), kPath_m);
  scene.model.friction = 0.0;
  EXPECT_EQ(largest_difference(smooth, simulate(scene), "theta_rad"), 0.0);
}

// Turning the body about e2 by pi exchanges its faces and keeps its motion: theta -> pi - theta,
// phi -> phi + pi, w1 -> -w1, w3 -> -w3. It checks the lower rim's side in every law.
TEST(ContactLimits, AMotionDoesNotKnowWhichFaceIsUp) {
  // The same steps but for rounding, which moves events, and jumps of the force with them.
  constexpr double kRoundingGrown = 1e-6;
  for (const char* name : {"s05_smooth_disc", "s06_roll_disc", "s08_slide_disc",
                           "s09_ring_retrograde_drag", "s10_stick_slip_event"}) {
    data::Scene scene = reference_scene(name);
    scene.run.until_s = 0.5;
    scene.run.tolerance = 1e-11;
    const Trajectory run = simulate(scene);
    scene.start.theta_rad = M_PI - *scene.start.theta_rad;
    scene.start.phi_rad = *scene.start.phi_rad + M_PI;
    scene.start.w1_rad_s = -*scene.start.w1_rad_s;
    scene.start.w3_rad_s = -*scene.start.w3_rad_s;
    const Trajectory turned = simulate(scene);
    ASSERT_EQ(run.values.rows(), turned.values.rows()) << name;
    for (const char* same : {"x_m", "y_m", "z_m", "w2_rad_s", "normal_force_N", "contact_x_m"})
      EXPECT_LE(largest_difference(run, turned, same), kRoundingGrown) << name << " " << same;
  }
}

// Skidding upright disc: friction mu g slows the centre and spins the disc up until v = 2/3 v0
// after |v0| / (3 mu g); the hoop ends at v0 / 2 after |v0| / (2 mu g).
TEST(ContactClosedForms, ASkiddingDiscRollsAtTwoThirdsOfItsSpeed) {
  constexpr double kSpeed_m_s = 1e-6, kTime_s = 1e-6;  // threshold of sticking, and over mu g
  for (const bool hoop : {false, true}) {
    data::Scene scene = disc_scene(0.0);
    if (hoop) {
      scene.body->kind = data::BodyKind::ring;
      scene.body->inner_radius_m = scene.body->radius_m;
    }
    scene.model.name = "sliding";
    scene.model.friction = 0.2;
    scene.start.theta_rad = M_PI / 2.0;
    scene.start.vx_m_s = 0.6;
    scene.run.until_s = 0.2;
    const Trajectory run = simulate(scene);
    ASSERT_EQ(run.events.size(), 1u);
    EXPECT_NEAR(run.events[0].t_s, 0.6 / ((hoop ? 2.0 : 3.0) * 0.2 * 9.81), kTime_s);
    EXPECT_NEAR(column(run, "vx_m_s").tail(1)[0], hoop ? 0.3 : 0.4, kSpeed_m_s);
    EXPECT_EQ(run.outcome, Outcome::reached_end);
  }
}

double tilt_after(data::Scene scene, double w2, double w3) {
  scene.start.theta_rad = M_PI / 2.0 - 1e-6;
  scene.start.w2_rad_s = w2;
  scene.start.w3_rad_s = w3;
  scene.run.until_s = 3.0;
  return (column(simulate(scene), "theta_rad").array() - M_PI / 2.0).abs().maxCoeff();
}

// Straight rolling is stable above v^2 = g R / 3 (disc) and g R / 4 (hoop), spinning upright above
// W^2 = 4 g / 5 R and 2 g / 3 R, for bodies without thickness. A small tilt then stays small.
TEST(ContactClosedForms, UprightMotionsAreStableAboveTheirThresholds) {
  for (const bool hoop : {false, true}) {
    data::Scene scene = disc_scene(0.0);
    scene.model.name = "rolling";
    if (hoop) {
      scene.body->kind = data::BodyKind::ring;
      scene.body->inner_radius_m = scene.body->radius_m;
    }
    const double g_R = 9.81 / 0.0375;
    const double rolling = std::sqrt(g_R / (hoop ? 4.0 : 3.0));
    const double spinning = std::sqrt(g_R * (hoop ? 2.0 / 3.0 : 4.0 / 5.0));
    // It begins at 1e-6 rad; three seconds are many growth times.
    constexpr double kStays_rad = 1e-4, kGrows_rad = 1e-3;
    EXPECT_LT(tilt_after(scene, 0.0, 1.05 * rolling), kStays_rad);
    EXPECT_GT(tilt_after(scene, 0.0, 0.95 * rolling), kGrows_rad);
    EXPECT_LT(tilt_after(scene, 1.05 * spinning, 0.0), kStays_rad);
    EXPECT_GT(tilt_after(scene, 0.95 * spinning, 0.0), kGrows_rad);
  }
}

// In a conservative run w2 and w3 obey a linear equation in theta: one value for each tilt, on the
// way up as on the way down.
TEST(ContactInvariants, TheSpinsAreFunctionsOfTheTilt) {
  data::Scene scene = reference_scene("s06_roll_disc");
  scene.run.tolerance = 1e-13;
  scene.run.rate_hz = 1e5;
  const Trajectory run = simulate(scene);
  const Eigen::VectorXd theta = column(run, "theta_rad"), w1 = column(run, "w1_rad_s");
  const Eigen::VectorXd w2 = column(run, "w2_rad_s"), w3 = column(run, "w3_rad_s");
  Eigen::Index first = 1;  // one falling half nutation serves as the table
  while (w1[first] > 0.0 || w1[first - 1] <= 0.0) ++first;
  Eigen::Index last = first;
  while (w1[last] < 0.0) ++last;
  constexpr double kInterpolation = 3e-8;  // (w1 / rate)^2 / 8 times the curvature
  int compared = 0;
  for (Eigen::Index n = last; n < theta.size(); n += 501) {
    Eigen::Index row = first;
    while (row < last && theta[row] > theta[n]) ++row;
    if (row == first || row == last) continue;
    const double u = (theta[n] - theta[row]) / (theta[row - 1] - theta[row]);
    EXPECT_NEAR(w2[n], w2[row] + u * (w2[row - 1] - w2[row]), kInterpolation);
    EXPECT_NEAR(w3[n], w3[row] + u * (w3[row - 1] - w3[row]), kInterpolation);
    ++compared;
  }
  EXPECT_GT(compared, 100);
}

TEST(ContactInvariants, ConservativeRunsKeepThem) {
  constexpr double kKept = 1e-10;
  for (const char* name : {"s05_smooth_disc", "s06_roll_disc", "s07_roll_hoop_thin"}) {
    data::Scene scene = reference_scene(name);
    scene.run.tolerance = 1e-13;
    const Trajectory run = simulate(scene);
    const Eigen::VectorXd energy = column(run, "energy_J");
    EXPECT_LE((energy.array() / energy[0] - 1.0).abs().maxCoeff(), kKept) << name;
  }
  data::Scene scene = reference_scene("s05_smooth_disc");
  scene.run.tolerance = 1e-13;
  const Trajectory run = simulate(scene);
  const double A = *scene.body->I_kg_m2, C = *scene.body->Is_kg_m2;
  const Eigen::ArrayXd theta = column(run, "theta_rad");
  const Eigen::ArrayXd w3 = column(run, "w3_rad_s");
  const Eigen::ArrayXd about_vertical =
      A * column(run, "w2_rad_s").array() * theta.sin() + C * w3 * theta.cos();
  EXPECT_LE((about_vertical / about_vertical[0] - 1.0).abs().maxCoeff(), kKept);
  EXPECT_LE((w3 / w3[0] - 1.0).abs().maxCoeff(), kKept);
  EXPECT_LE((column(run, "vx_m_s").array() - 0.1).abs().maxCoeff(), kKept);
}

/// A nearly flat spinning disc with one loss, at rest in its centre.
data::Scene falling(double tilt_rad) {
  data::Scene scene = disc_scene(0.0);
  scene.model.name = "rolling";
  scene.start.theta_rad = tilt_rad;
  const double s = std::sin(tilt_rad);
  scene.start.dphi_rad_s = std::sqrt(4.0 * 9.81 / (0.0375 * s));
  scene.start.w3_rad_s = 0.0;
  scene.run.tolerance = 1e-11;
  return scene;
}

/// Exponent n of E ~ (t0 - t)^n from p = -E / (dE/dt) = (t0 - t)/n at two times: n = -dt/dp.
double exponent(const data::Scene& scene) {
  const Trajectory run = simulate(scene);
  const Eigen::VectorXd t = column(run, "t_s"), energy = column(run, "energy_J");
  const Eigen::Index rows = t.size(), span = rows / 20;
  const auto p = [&](Eigen::Index n) {
    return -energy[n] * (t[n + span] - t[n - span]) / (energy[n + span] - energy[n - span]);
  };
  const Eigen::Index early = rows / 10, late = rows - 1 - rows / 10;
  return -(t[late] - t[early]) / (p(late) - p(early));
}

// alpha ~ (t0 - t)^n while the disc falls through nearly steady motions (sliding.md, (S20)): n =
// 2/3 for dry contour friction, 2 for dry rolling friction, 1/3 for the viscous layer of air. Runs
// start at 0.05 rad and end well before the singularity; the rest is of second order in the tilt.
TEST(LastStage, FollowsThePowerLawOfEachLoss) {
  constexpr double kSecondOrder = 0.02;
  data::Scene contour = falling(0.05);
  contour.model.contour_friction_m = 2e-6;
  contour.run.until_s = 4.0;
  EXPECT_NEAR(exponent(contour), 2.0 / 3.0, kSecondOrder);
  data::Scene rolling = falling(0.05);
  rolling.model.rolling_friction_m = 5e-5;
  rolling.run.until_s = 1.0;
  EXPECT_NEAR(exponent(rolling), 2.0, 4.0 * kSecondOrder);
  data::Scene gap = falling(0.05);
  gap.model.gap_viscosity_Pa_s = 1.8e-5;
  gap.run.until_s = 1.2;
  EXPECT_NEAR(exponent(gap), 1.0 / 3.0, kSecondOrder);
}

// The last 10 ms: W grows past 500 rad/s until a face touches or the normal force vanishes.
TEST(LastStage, EndsByNameWithinItsLastTenMilliseconds) {
  for (const double thickness_m : {0.0, 0.006}) {
    data::Scene scene = falling(0.02);
    scene.body->thickness_m = thickness_m;
    scene.model.contour_friction_m = 4e-5;
    scene.run.until_s = 1.0;
    scene.run.rate_hz = 1e5;
    const Trajectory run = simulate(scene);
    EXPECT_TRUE(run.outcome == Outcome::flat || run.outcome == Outcome::lift_off)
        << name(run.outcome);
    EXPECT_TRUE(run.values.allFinite());
    EXPECT_LT(run.end_s, 0.3);
    const Eigen::VectorXd energy = column(run, "energy_J");
    for (Eigen::Index n = 1; n < energy.size(); ++n) EXPECT_LE(energy[n], energy[n - 1]);
  }
}

// Thin disc, slip across the node line towards the contact: no force fits once
// mu > (tan + 5 / tan)/4 of the tilt, least at tan^2 = 5, where it is 1.118.
TEST(Painleve, IsNamedWhereNoContactForceExists) {
  data::Scene scene = disc_scene(0.0);
  scene.model.name = "sliding";
  scene.start.theta_rad = std::atan(std::sqrt(5.0));
  scene.start.vx_m_s = 0.0;
  scene.start.vy_m_s = -0.5;  // phi = 0: mh = y
  scene.run.until_s = 0.1;
  scene.model.friction = 1.15;
  EXPECT_EQ(simulate(scene).outcome, Outcome::inconsistent_contact);
  scene.model.friction = 1.10;
  EXPECT_NE(simulate(scene).end_s, 0.0);
}

// The regularised law tends to the exact one linearly in eps_v, measured 7.5e-2 rad at 1e-3 m/s
// down to 5.4e-6 at 1e-8 over 2 s and 20 changes of regime: two programs of their own, events here
// and a stiff solver there, meet. The last figure is the error of both.
TEST(RegularisedFriction, TendsToTheExactLaw) {
  data::Scene scene = reference_scene("s10_stick_slip_event");
  scene.run.tolerance = 1e-10;
  const Trajectory exact = simulate(scene);
  const double known[] = {7.5e-2, 1.3e-2, 1.8e-3, 2.7e-4, 4e-5, 5.4e-6, 2e-6};
  for (int power = 3; power <= 9; ++power) {
    scene.model.slip_regularisation_m_s = std::pow(10.0, -power);
    scene.run.tolerance = 1e-9;
    const Trajectory run = simulate(scene);
    ASSERT_EQ(run.outcome, Outcome::reached_end) << "eps_v = 1e-" << power;
    EXPECT_LE(largest_difference(run, exact, "theta_rad"), 1.3 * known[power - 3])
        << "eps_v = 1e-" << power;
  }
}

// A body that turns fast would have to be pushed sideways as hard as upwards to rest on its new rim
// at once: friction of 0.3 cannot, under either law.
TEST(RegularisedFriction, TendsToTheExactLawAcrossAnImpact) {
  data::Scene scene = disc_scene(0.008);
  scene.model.name = "sliding";
  scene.model.friction = 0.3;
  scene.start.theta_rad = 1.45;
  scene.start.w1_rad_s = 5.0;
  scene.start.w2_rad_s = 15.0;
  scene.start.w3_rad_s = 2.0;
  scene.run.until_s = 0.06;
  scene.run.rate_hz = 1000.0;
  scene.run.tolerance = 1e-10;
  scene.run.rim_switch = "impact";
  const Trajectory exact = simulate(scene);
  ASSERT_EQ(exact.outcome, Outcome::reached_end);
  ASSERT_EQ(exact.events.front().name, "rim_switch");
  for (const double eps_v_m_s : {1e-4, 1e-5, 1e-6}) {
    scene.model.slip_regularisation_m_s = eps_v_m_s;
    const Trajectory run = simulate(scene);
    constexpr double kOfSlip_1_m = 10.0;  // measured 6.7; the creep of eps_v, of a body of 4 cm
    EXPECT_LE(largest_difference(run, exact, "w3_rad_s"), kOfSlip_1_m * eps_v_m_s) << eps_v_m_s;
    EXPECT_LE(largest_difference(run, exact, "w1_rad_s"), kOfSlip_1_m * eps_v_m_s) << eps_v_m_s;
  }
}

// Whatever the start: a named end, no NaN, energy that never grows.
TEST(AnyStart, EndsByNameAndNeverGainsEnergy) {
  constexpr unsigned kSeed = 20;
  std::mt19937 draw(kSeed);
  std::uniform_real_distribution<double> u(0.0, 1.0);
  for (int i = 0; i < 150; ++i) {
    data::Scene scene = disc_scene(u(draw) < 0.3 ? 0.0 : 0.02 * u(draw));
    const char* const laws[] = {"smooth", "rolling", "sliding"};
    scene.model.name = laws[i % 3];
    scene.model.friction = 0.05 + 1.2 * u(draw);
    if (i % 6 == 2) scene.model.slip_regularisation_m_s = 1e-3;
    if (u(draw) < 0.5) scene.model.pivoting_friction_m = 1e-3 * u(draw);
    if (u(draw) < 0.5) scene.model.rolling_friction_m = 1e-3 * u(draw);
    if (u(draw) < 0.3) scene.model.air_quadratic_N_m_s2 = Eigen::Vector3d(1e-7, 1e-7, 1e-7);
    if (u(draw) < 0.3) scene.run.rim_switch = "impact";
    scene.start.theta_rad = 0.05 + 3.0 * u(draw);
    scene.start.w1_rad_s = 10.0 * (u(draw) - 0.5);
    scene.start.w2_rad_s = 60.0 * (u(draw) - 0.5);
    scene.start.w3_rad_s = 60.0 * (u(draw) - 0.5);
    if (u(draw) < 0.5) scene.start.vx_m_s = u(draw) - 0.5;
    scene.run.until_s = 0.5;
    scene.run.tolerance = 1e-9;
    const Trajectory run = simulate(scene);
    EXPECT_TRUE(run.values.allFinite()) << i;
    EXPECT_TRUE(run.outcome != Outcome::out_of_domain && run.outcome != Outcome::step_limit)
        << i << " " << name(run.outcome) << " at " << run.end_s;
    const Eigen::VectorXd energy = column(run, "energy_J");
    for (Eigen::Index n = 1; n < energy.size(); ++n)
      ASSERT_LE(energy[n], energy[n - 1] * (1.0 + 1e-7)) << i << " " << scene.model.name;
  }
}

}  // namespace
}  // namespace trochoid::model
