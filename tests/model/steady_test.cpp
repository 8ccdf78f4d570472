#include "trochoid/model/steady.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "trochoid/data/error.hpp"
#include "trochoid/model/inertia.hpp"
#include "trochoid/model/rolling.hpp"

namespace trochoid::model {
namespace {

constexpr double kGravity = 9.81;
constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kRounding = 1e-12;   // relative, of a closed form of a few operations
constexpr double kCancelled = 1e-10;  // of one whose terms cancel to some digits

data::Body disc(double thickness_m) {
  data::Body body;
  body.radius_m = 0.0375;
  body.thickness_m = thickness_m;
  body.mass_kg = 0.05964117303299373;
  return body;
}

data::Body hoop() {
  data::Body body;
  body.kind = data::BodyKind::ring;
  body.radius_m = body.inner_radius_m = 0.03;
  body.mass_kg = 0.02;
  body.I_kg_m2 = 9e-6;
  body.Is_kg_m2 = 1.8e-5;
  return body;
}

// Aluminium disc of 5 mm; frequencies from an independent simulation of nutations that were small,
// not infinitesimal.
TEST(SteadyRolling, NutatesAtTheFrequenciesOfSimulatedSmallNutations) {
  constexpr double kOfThatSize = 5e-4;
  struct Case {
    double tilt_deg, precession, nu;
  };
  for (const auto& [tilt_deg, precession, nu] :
       {Case{70.0, 26.0, 21.7303}, Case{40.0, 25.0, 24.3358}, Case{20.0, 35.0, 37.4834}}) {
    const SteadyMotion motion =
        steady_rolling(disc(0.005), kGravity, tilt_deg * kDegree, precession);
    EXPECT_NEAR(std::sqrt(motion.nutation2_1_s2), nu, kOfThatSize) << tilt_deg;
  }
}

// nu^2 (A + mR^2) / W^2 = 3A c^2 + mR^2 s^2 + k3 [(C + mR^2) s^2/c - (3C + mR^2) c]
//                         + k3^2 C (C + mR^2) / A for a thin body, k3 = w3 / W.
TEST(SteadyRolling, OfAThinBodyHasTheClosedFormFrequency) {
  const data::Body body = hoop();
  const double A = 9e-6, C = 1.8e-5, mR2 = 0.02 * 0.03 * 0.03;
  for (const double theta : {0.3, 0.8, 1.3}) {
    const SteadyMotion motion = steady_rolling(body, kGravity, theta, 24.0);
    const double s = std::sin(theta), c = std::cos(theta), k3 = motion.w3_rad_s / 24.0;
    const double expected =
        24.0 * 24.0 / (A + mR2) *
        (3 * A * c * c + mR2 * s * s + k3 * ((C + mR2) * s * s / c - (3 * C + mR2) * c) +
         k3 * k3 * C * (C + mR2) / A);
    EXPECT_NEAR(motion.nutation2_1_s2 / expected, 1.0, kCancelled);
  }
}

// Equation (1) read two ways: the spin at a precession, and the precessions at the speed that this
// spin gives. The speed is a difference, which costs some digits. At the last tilt the quadratic
// term vanishes, and one root with it.
TEST(SteadyRolling, PrecessesAtOneOfTheRatesThatItsSpeedAsksFor) {
  const RimBody body{.m = 0.06, .A = 2.1e-5, .C = 4.2e-5, .R = 0.0375, .h = 0.0025};
  const double linear_rad = std::atan(body.A * body.R / (body.C * body.h));
  for (const double theta : {0.3, 0.8, 1.3, linear_rad})
    for (const double W : {-30.0, 12.0, 25.0}) {
      const double w3 = steady_rolling_spin(body, theta, W);
      const double along_m_s = body.h * W * std::sin(theta) - body.R * w3;
      const std::vector<double> rates = steady_rolling_precessions(body, theta, along_m_s);
      ASSERT_FALSE(rates.empty());
      EXPECT_LT(std::min(std::abs(rates.front() / W - 1.0), std::abs(rates.back() / W - 1.0)),
                kCancelled);
    }
}

// Beyond pi/2 a body stands on its other rim: the same motion, called by its other face. The axis,
// the node line and with it the speed along it turn round, the precession does not.
TEST(SteadyRolling, IsTheSameCalledByTheOtherFace) {
  const RimBody body{.m = 0.06, .A = 2.1e-5, .C = 4.2e-5, .R = 0.0375, .h = 0.0025};
  RimBody other = body;
  other.side = -1.0;
  for (const double theta : {0.3, 0.8, 1.3})
    for (const double W : {-30.0, 12.0}) {
      const double beyond = std::numbers::pi - theta, w3 = steady_rolling_spin(body, beyond, W);
      EXPECT_NEAR(w3, -steady_rolling_spin(body, theta, W), kCancelled * std::abs(w3));
      const Rolling<double> system{.body = other, .losses = {}};
      State<double, Rolling<double>::kStates> y{};
      y[Rim::theta] = beyond;
      y[Rim::w2] = W * std::sin(beyond);
      y[Rim::w3] = w3;
      const double falling = body.m * kGravity * body.R / body.A;  // the size of what cancels
      EXPECT_NEAR(system.acceleration(system.motion(y)).w1, 0.0, kCancelled * falling);
      const std::vector<double> rates = steady_rolling_precessions(body, theta, 0.2),
                                beyond_rates = steady_rolling_precessions(body, beyond, -0.2);
      ASSERT_EQ(beyond_rates.size(), rates.size());
      ASSERT_FALSE(rates.empty());
      EXPECT_NEAR(beyond_rates.front() / rates.back(), 1.0, kCancelled);
    }
}

TEST(SteadyRolling, WithTheCentreAtRestIsTheEulerDisc) {
  const double theta = 0.2;
  const auto motion = steady_rolling_on_circle(disc(0.0), kGravity, theta, 0.0);
  ASSERT_TRUE(motion);
  EXPECT_EQ(motion->kind, SteadyKind::tilted_spinning);
  const double expected = std::sqrt(4.0 * kGravity / (0.0375 * std::sin(theta)));
  EXPECT_NEAR(motion->precession_rad_s / expected, 1.0, kRounding);
  EXPECT_NEAR(motion->w3_rad_s, 0.0, kRounding * expected);
  EXPECT_NEAR(motion->friction_demand, 0.0, kRounding);
}

TEST(SteadyRolling, OnACircleIsTheMotionOfThatPrecessionAndDemandsTheCentripetalForce) {
  const auto circle = steady_rolling_on_circle(disc(0.005), kGravity, 1.0, 0.08);
  ASSERT_TRUE(circle);
  EXPECT_NEAR(circle->circle_radius_m, 0.08, kRounding);
  const double W = circle->precession_rad_s;
  EXPECT_NEAR(circle->friction_demand, 0.08 * W * W / kGravity, kCancelled);
  EXPECT_NEAR(circle->normal_force_N, 0.05964117303299373 * kGravity, kRounding);
  const SteadyMotion same = steady_rolling(disc(0.005), kGravity, 1.0, W);
  EXPECT_NEAR(same.w3_rad_s / circle->w3_rad_s, 1.0, kCancelled);
}

TEST(SteadyMotion, OnASmoothFloorBalancesGravityByGyroscopicCouples) {
  const data::Body body = disc(0.005);
  const CentralInertia inertia = central_inertia(body);
  const double theta = 0.7, w3 = 60.0, s = std::sin(theta), c = std::cos(theta);
  const auto motions = steady_smooth(body, kGravity, theta, w3);
  ASSERT_EQ(motions.size(), 2u);
  EXPECT_LT(std::abs(motions[0].precession_rad_s), std::abs(motions[1].precession_rad_s));
  for (const SteadyMotion& motion : motions) {
    const double W = motion.precession_rad_s;
    const double weight = inertia.mass_kg * kGravity * (0.0025 * s - 0.0375 * c);
    EXPECT_NEAR(
        inertia.transverse_kg_m2 * W * W * s * c - inertia.axial_kg_m2 * W * s * w3 + weight, 0.0,
        1e-12);
    EXPECT_EQ(motion.friction_demand, 0.0);
  }
}

TEST(SteadyMotion, UprightRatesAreThoseOfThinDiscAndHoop) {
  const double R = 0.0375;
  EXPECT_NEAR(std::pow(least_rolling_rate_rad_s(disc(0.0), kGravity) * R, 2), kGravity * R / 3,
              1e-12);
  EXPECT_NEAR(std::pow(least_rolling_rate_rad_s(hoop(), kGravity) * 0.03, 2), kGravity * 0.03 / 4,
              1e-12);
  EXPECT_NEAR(std::pow(least_spinning_rate_rad_s(disc(0.0), kGravity), 2), 4 * kGravity / (5 * R),
              1e-9);
  EXPECT_NEAR(std::pow(least_spinning_rate_rad_s(hoop(), kGravity), 2), 2 * kGravity / (3 * 0.03),
              1e-9);
}

TEST(SteadyCatalogue, HoldsEveryFamilyOnBothFloorsAndNoMotionWithoutSupport) {
  const auto motions = steady_catalogue(disc(0.0), kGravity, {0.4, 1.0});
  int rough = 0, smooth = 0;
  for (const SteadyMotion& motion : motions) {
    ++(motion.floor == Floor::rough ? rough : smooth);
    EXPECT_GT(motion.normal_force_N, 0.0);
  }
  EXPECT_GE(rough, 3 + 2 * 4);
  EXPECT_GE(smooth, 1 + 2 * 3);
}

TEST(SteadyRolling, RefusesATiltOutsideTheQuadrant) {
  EXPECT_THROW((void)steady_rolling(disc(0.0), kGravity, 1.6, 10.0), InputError);
  EXPECT_THROW((void)steady_rolling(disc(0.0), kGravity, 1.0, 0.0), InputError);
}

}  // namespace
}  // namespace trochoid::model
