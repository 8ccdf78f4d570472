#include "trochoid/model/mean_path.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "trochoid/data/error.hpp"
#include "trochoid/model/events.hpp"
#include "trochoid/model/rolling.hpp"
#include "trochoid/model/steady.hpp"

namespace trochoid::model {
namespace {

using RollingInAir = Rolling<double, LinearAir>;

// Ring 30/27 mm, 2h = 8 mm, air couple c3 = 6 c1, rolling from near steady motion for 9 s; or the
// disc of the same mass, radius and material (so 1.52 mm thick) with the couple scaled by its
// transverse moment.
RimBody ring_body() {
  return {.m = 0.03373693518837008,
          .A = 1.3919297176468351e-05,
          .C = 2.7478733710927426e-05,
          .R = 0.03,
          .h = 0.004};
}

MeanPath roll(const RimBody& body, double c1, double precession, double w3) {
  RollingInAir system{.body = body, .losses = {{c1, c1, 6.0 * c1}}};
  const double theta = 1.2566370614359172;
  DormandPrince<RollingInAir> stepper(system, uniform_control<8>(1e-10));
  State<double, 8> start{};
  start[Rim::theta] = theta;
  start[Rim::w2] = precession * std::sin(theta);
  start[Rim::w3] = w3;
  stepper.start(0.0, start);
  constexpr int kRows = 9 * 120 + 1;
  Eigen::VectorXd t = Eigen::VectorXd::LinSpaced(kRows, 0.0, 9.0), phi(kRows), x(kRows), y(kRows);
  const auto keep = [&](const auto& at, int first, int last) {
    for (int i = first; i < last; ++i) {
      const double u = at.fraction(t[i]);
      phi[i] = at.dense_value(Rim::phi, u);
      x[i] = at.dense_value(Rim::x, u);
      y[i] = at.dense_value(Rim::y, u);
    }
  };
  const auto run = integrate(stepper, 9.0, t.data(), kRows, keep);
  EXPECT_EQ(run.end, RunEnd::reached_end);
  return mean_path(t, phi, x, y);
}

// Heading rates in eight parts and the inflection from an independent evaluation of the reference
// run s09, which cuts the run's ends a little differently: hence the allowances.
TEST(MeanPath, OfARingInAirTurnsRetrogradeWhereTheReferenceSays) {
  const MeanPath path = roll(ring_body(), 2.5e-6, 26.0, 4.419239954938856);
  const std::vector<double> expected{0.1779,  0.1973,  0.1487,  0.0528,
                                     -0.0193, -0.0604, -0.0812, -0.0905};
  const Eigen::VectorXd rates = path.heading_in_parts(8);
  for (int i = 0; i < 8; ++i) EXPECT_NEAR(rates[i], expected[static_cast<std::size_t>(i)], 0.012);
  ASSERT_TRUE(path.inflection_s());
  EXPECT_NEAR(*path.inflection_s(), 5.026, 0.1);
}

TEST(MeanPath, OfADiscOfTheSameMassAndRadiusStaysPrograde) {
  RimBody disc = ring_body();
  disc.h = 0.004 * (1.0 - 0.9 * 0.9);  // the bore of 0.9 R filled, the thickness reduced instead
  disc.A = disc.m * (3.0 * disc.R * disc.R + 4.0 * disc.h * disc.h) / 12.0;
  disc.C = 0.5 * disc.m * disc.R * disc.R;
  data::Body shape;
  shape.radius_m = disc.R;
  shape.thickness_m = 2.0 * disc.h;
  shape.mass_kg = disc.m;
  const double w3 = steady_rolling(shape, disc.g, 1.2566370614359172, 30.0).w3_rad_s + 2.0;
  const MeanPath path = roll(disc, 2.5e-6 * disc.A / ring_body().A, 30.0, w3);
  EXPECT_FALSE(path.inflection_s());
  EXPECT_GT(path.heading_in_parts(8).minCoeff(), 0.0);
}

TEST(MeanPath, OfACircleWithSmallFastLoopsIsTheCircle) {
  const int n = 4001;
  const Eigen::VectorXd t = Eigen::VectorXd::LinSpaced(n, 0.0, 10.0), phi = 20.0 * t;
  const double slow = 0.1;  // heading per phi
  const Eigen::VectorXd x = (slow * phi.array()).cos() + 0.05 * phi.array().cos();
  const Eigen::VectorXd y = (slow * phi.array()).sin() + 0.05 * phi.array().sin();
  const MeanPath path = mean_path(t, phi, x, y);
  const double interpolation = 1e-4;
  EXPECT_NEAR(path.heading_per_phi.minCoeff(), slow, interpolation);
  EXPECT_NEAR(path.heading_per_phi.maxCoeff(), slow, interpolation);
}

TEST(MeanPath, RefusesARunOfLessThanThreeTurnsOrWithoutSteadyPrecession) {
  const Eigen::VectorXd t = Eigen::VectorXd::LinSpaced(100, 0.0, 1.0), zero = 0.0 * t;
  EXPECT_THROW((void)mean_path(t, 10.0 * t, zero, zero), InputError);
  EXPECT_THROW((void)mean_path(t, 40.0 * (6.0 * t.array()).sin(), zero, zero), InputError);
}

}  // namespace
}  // namespace trochoid::model
