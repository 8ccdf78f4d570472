#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "common.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/model/predictor.hpp"
#include "trochoid/model/puck.hpp"
#include "trochoid/model/simulate.hpp"

namespace trochoid::model {
namespace {

/// Force and couple over mu N of a full face at e = v / (R w).
struct FaceLaw {
  double force, couple;
};
FaceLaw law(double e) {
  const auto f = face_force<double>(e, 0.0, 1.0);
  return {f.x, f.couple};
}

// Values of [Farkas2003]'s closed form; ten digits were given.
TEST(FaceFriction, HasItsKnownValues) {
  constexpr double kDigits = 1e-10;
  EXPECT_NEAR(law(0.3).force, 0.2965859192, kDigits);
  EXPECT_NEAR(law(0.3).couple, 0.6224358261, kDigits);
  EXPECT_NEAR(law(1.5).force, 0.9408193755, kDigits);
  EXPECT_NEAR(law(1.5).couple, 0.1737981055, kDigits);
}

TEST(FaceFriction, HasItsLimits) {
  constexpr double kRounding = 1e-13;
  EXPECT_NEAR(law(1.0).force, 8.0 / (3.0 * M_PI), kRounding);
  EXPECT_NEAR(law(1.0).couple, 8.0 / (9.0 * M_PI), kRounding);
  EXPECT_NEAR(law(1.0 + 1e-9).couple, 8.0 / (9.0 * M_PI), 1e-8);  // its slope is logarithmic there
  EXPECT_NEAR(law(1e-7).force, 1e-7, 1e-7 * kRounding);
  EXPECT_NEAR(law(1e-7).couple, 2.0 / 3.0, kRounding);
  EXPECT_NEAR(law(1e7).force, 1.0, kRounding);
  EXPECT_NEAR(law(1e7).couple * 4e7, 1.0, kRounding);
  EXPECT_EQ(face_force<double>(0.3, 0.4, 0.0).couple, 0.0);
  EXPECT_EQ(face_force<double>(0.0, 0.0, 2.0).x, 0.0);
}

/// Coulomb's law integrated over the face by the midpoint rule in both polar coordinates.
FaceLaw quadrature(double e, double bore) {
  constexpr int kRadii = 400, kAngles = 400;
  double force = 0.0, couple = 0.0, area = 0.0;
  for (int i = 0; i < kRadii; ++i) {
    const double r = bore + (1.0 - bore) * (i + 0.5) / kRadii;
    for (int j = 0; j < kAngles; ++j) {
      const double a = 2.0 * M_PI * (j + 0.5) / kAngles;
      const double ux = e - r * std::sin(a), uy = r * std::cos(a), u = std::hypot(ux, uy);
      force += r * ux / u;
      couple += r * r * (std::cos(a) * uy - std::sin(a) * ux) / u;
      area += r;
    }
  }
  return {force / area, couple / area};
}

TEST(FaceFriction, IsCoulombsLawIntegratedOverDiscAndRing) {
  constexpr double kQuadrature = 2e-4;  // the integrand has a kink where the slip vanishes
  for (const double e : {0.2, 0.9, 1.4}) {
    EXPECT_NEAR(law(e).force, quadrature(e, 0.0).force, kQuadrature);
    EXPECT_NEAR(law(e).couple, quadrature(e, 0.0).couple, kQuadrature);
    Puck<double> ring;
    ring.friction = 1.0;
    ring.gravity = 1.0;
    ring.radius = 1.0;
    ring.bore = 0.6;
    ring.gyration = 1.0;
    const auto f = ring.acceleration({e, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0});
    EXPECT_NEAR(-f.x, quadrature(e, 0.6).force, kQuadrature);
    EXPECT_NEAR(-f.couple, quadrature(e, 0.6).couple, kQuadrature);
  }
}

data::Scene puck_scene() {
  data::Scene scene;
  scene.body.emplace();
  scene.body->radius_m = 0.03;
  scene.body->thickness_m = 0.005;
  scene.support.kind = data::SupportKind::flat;
  scene.model.friction = 0.2;
  scene.start.x_m = 0.1;
  scene.start.y_m = -0.05;
  scene.start.vx_m_s = 0.8;
  scene.start.vy_m_s = 0.6;
  scene.start.psi_rad = 0.3;
  scene.start.w3_rad_s = 0.0;
  scene.run.until_s = 1.0;
  scene.run.rate_hz = 100.0;
  scene.run.tolerance = 1e-12;
  return scene;
}

// At 1e-9 of its first speed a puck counts as at rest: what is left would take less than that [s].
constexpr double kRest_s = 1e-8;
constexpr double kPath_m = 1e-11;    // tolerance 1e-12, of some dozen steps
constexpr double kAngle_rad = 1e-9;  // 1e-12 of spins of some 30 rad/s
constexpr double kPivot_rad = 1e-8;  // a hundred local errors at the tolerance of 1e-10

// Without spin the deceleration is mu g: s = v0 t - mu g t^2 / 2, rest after v0 / (mu g).
TEST(Puck, StopsLikeABlockWhenItDoesNotSpin) {
  const data::Scene scene = puck_scene();
  const Trajectory run = simulate(scene);
  const double a = 0.2 * 9.81, rest_s = 1.0 / a;
  EXPECT_EQ(run.outcome, Outcome::at_rest);
  ASSERT_EQ(run.events.size(), 1u);
  EXPECT_NEAR(run.events[0].t_s, rest_s, kRest_s);
  ASSERT_EQ(run.values.rows(), 101);
  for (Eigen::Index n = 0; n < run.values.rows(); ++n) {
    const double t = std::min(0.01 * static_cast<double>(n), rest_s);
    const double s = t - 0.5 * a * t * t;
    EXPECT_NEAR(column(run, "x_m")[n], 0.1 + 0.8 * s, kPath_m);
    EXPECT_NEAR(column(run, "y_m")[n], -0.05 + 0.6 * s, kPath_m);
    EXPECT_EQ(column(run, "psi_rad")[n], 0.3);
  }
}

TEST(Puck, NeedsAWeight) {
  data::Scene scene = puck_scene();
  scene.model.gravity_m_s2 = 0.0;
  EXPECT_THROW(static_cast<void>(simulate(scene)), InputError);
}

// Pure spinning: dw/dt = -mu g R (2/3) / (C/m), C/m = R^2/2.
TEST(Puck, SpinsDownUniformlyInPlace) {
  data::Scene scene = puck_scene();
  scene.start.vx_m_s = scene.start.vy_m_s = 0.0;
  scene.start.w3_rad_s = -30.0;
  const Trajectory run = simulate(scene);
  const double a = 0.2 * 9.81 * 4.0 / (3.0 * 0.03), rest_s = 30.0 / a;
  EXPECT_NEAR(run.events.at(0).t_s, rest_s, kRest_s);
  EXPECT_NEAR(column(run, "psi_rad")[100], 0.3 - 450.0 / a, kAngle_rad);
  EXPECT_EQ(column(run, "x_m")[100], 0.1);
}

// The couple is that of the ground it covers, the inertia that of the whole body.
TEST(Puck, SpinsDownMoreSlowlyOnASmallerContact) {
  constexpr double kContact_m = 0.01;
  data::Scene scene = puck_scene();
  scene.body->mass_kg = 0.1;
  scene.model.contact_radius_m = kContact_m;
  scene.start.vx_m_s = scene.start.vy_m_s = 0.0;
  scene.start.w3_rad_s = -10.0;
  const Trajectory run = simulate(scene);
  const double a = 0.2 * 9.81 * 4.0 / (3.0 * 0.03) * kContact_m / 0.03;
  const double t_s = 0.2, w_rad_s = -10.0 + a * t_s;
  EXPECT_NEAR(column(run, "w3_rad_s")[20], w_rad_s, kAngle_rad);
  EXPECT_NEAR(column(run, "psi_rad")[20], 0.3 - 10.0 * t_s + 0.5 * a * t_s * t_s, kAngle_rad);
  const double lost_J = column(run, "energy_J")[0] - column(run, "energy_J")[20];
  const double axial_kg_m2 = 0.5 * 0.1 * 0.03 * 0.03;
  EXPECT_NEAR(lost_J, 0.5 * axial_kg_m2 * (100.0 - w_rad_s * w_rad_s), 1e-12);
}

// The uniform disc comes to rest in both motions at once, with e -> 0.653 [Farkas2003].
TEST(Puck, EndsBothMotionsTogetherAtTheKnownRatio) {
  Puck<double> puck;
  puck.friction = 0.2;
  puck.radius = 0.03;
  State<double, 7> y{1.0, 0.0, 0.2, 0.0, 0.0, 0.0, 0.0};
  DormandPrince<Puck<double>> stepper(puck, uniform_control<7>(1e-12));
  stepper.start(0.0, y);
  while (stepper.y()[0] > 1e-8) ASSERT_EQ(stepper.step(1e3), StepEnd::accepted);
  constexpr double kThirdDigit = 5e-4;
  EXPECT_NEAR(stepper.y()[0] / stepper.y()[2], 0.653, kThirdDigit);
}

void expect_derivatives(const Predictor& predictor, std::span<const double> t_s,
                        std::vector<Observable> observables) {
  const auto& list = predictor.parameters();
  Eigen::VectorXd values(static_cast<Eigen::Index>(list.size()));
  for (Eigen::Index i = 0; i < values.size(); ++i)
    values[i] = list[static_cast<std::size_t>(i)].value;
  PredictRequest request;
  request.t_s = t_s;
  request.observables = std::move(observables);
  request.tolerance = 1e-13;
  request.want_end_state = true;
  for (int i = 0; i < values.size(); ++i) request.derivatives.push_back(i);
  const Prediction exact = predictor.predict(values, request);
  EXPECT_EQ(exact.outcome, Outcome::reached_end);
  EXPECT_TRUE(exact.values.allFinite());
  request.derivatives.clear();
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const double h = 1e-4 * std::max(std::abs(values[i]), 0.1);
    const auto at = [&](double offset) {
      Eigen::VectorXd moved = values;
      moved[i] += offset;
      return predictor.predict(moved, request);
    };
    const Prediction a = at(h), b = at(-h), a2 = at(2.0 * h), b2 = at(-2.0 * h);
    const double scale = 1.0 / (12.0 * h);
    const Eigen::VectorXd path = (8.0 * (a.values - b.values) - (a2.values - b2.values)) * scale;
    const Eigen::VectorXd end =
        (8.0 * (a.end_state - b.end_state) - (a2.end_state - b2.end_state)) * scale;
    // Differences: 1e-13 / h of rounding, and more beside the kink at rest.
    constexpr double kDifference = 1e-6;
    EXPECT_LE((exact.jacobian.col(i) - path).cwiseAbs().maxCoeff(),
              kDifference * (1.0 + path.cwiseAbs().maxCoeff()))
        << list[static_cast<std::size_t>(i)].name;
    EXPECT_LE((exact.end_state_jacobian.col(i) - end).cwiseAbs().maxCoeff(),
              kDifference * (1.0 + end.cwiseAbs().maxCoeff()))
        << list[static_cast<std::size_t>(i)].name;
  }
}

TEST(Puck, DifferentiatesByEveryParameterMovingAndAtRest) {
  data::Scene scene = puck_scene();
  scene.body->mass_kg = 0.05;
  scene.model.air_force_N_s_m = 2e-3;
  scene.support.slope_x = 0.01;
  scene.support.slope_y = -0.02;
  for (const double w3 : {0.0, 4.0, -40.0, 200.0}) {
    scene.start.w3_rad_s = w3;
    expect_derivatives(*make_predictor(scene), std::vector{0.1, 0.3, 0.42, 3.0},
                       {Observable::x_m, Observable::y_m, Observable::psi_rad});
  }
}

// On a small contact it spins on for long while any velocity of its centre dies at once: nothing in
// the path, a point, asks for short steps. Friction only takes away from how far a push leads.
TEST(Puck, SpinningOnASmallContactGoesNoFartherByAPushThanWithoutFriction) {
  data::Scene scene = puck_scene();
  scene.model.friction = 1.0;
  scene.model.contact_radius_m = 1e-3 * scene.body->radius_m;
  scene.start.vx_m_s = scene.start.vy_m_s = 0.0;
  scene.start.w3_rad_s = -90.0;
  const auto predictor = make_predictor(scene);
  const std::vector<double> t_s{0.5, 1.0, 2.0};
  PredictRequest request;
  request.t_s = t_s;
  request.derivatives = {predictor->index_of("vx_m_s")};
  const Prediction run = predictor->predict(defaults(*predictor), request);
  for (std::size_t n = 0; n < t_s.size(); ++n) {
    const double by_push_s = run.jacobian(static_cast<Eigen::Index>(2 * n), 0);
    EXPECT_GT(by_push_s, 0.0);
    EXPECT_LT(by_push_s, t_s[n]);
  }
}

TEST(Puck, HasAContactThatIsNeitherNothingNorWiderThanARimMakesIt) {
  data::Scene scene = puck_scene();
  for (const double of_radius : {0.0, 1e-4, -1.0, 1.6, std::nan("")}) {
    scene.model.contact_radius_m = of_radius * scene.body->radius_m;
    EXPECT_THROW((void)simulate(scene), InputError) << of_radius;
    EXPECT_THROW((void)make_predictor(scene), InputError) << of_radius;
  }
}

// Where it would turn back, or set off, there is no answer; it had been said to rest.
TEST(Puck, DoesNotRestOnAFloorTooSteepForItsFriction) {
  data::Scene scene = puck_scene();
  scene.model.friction = 0.05;
  scene.support.slope_x = 0.1;
  scene.start.vy_m_s = scene.start.w3_rad_s = 0.0;
  const std::vector<double> t_s{0.0, 0.01, 60.0};
  PredictRequest request;
  request.t_s = t_s;
  for (const double vx_m_s : {0.3, 0.0}) {
    scene.start.vx_m_s = vx_m_s;
    const auto predictor = make_predictor(scene);
    const Prediction run = predictor->predict(defaults(*predictor), request);
    EXPECT_EQ(run.outcome, Outcome::out_of_domain) << vx_m_s;
    EXPECT_TRUE(run.values.head(2).allFinite()) << vx_m_s;
    EXPECT_TRUE(run.values.tail(2).array().isNaN().all()) << vx_m_s;
  }
}

TEST(Puck, StaysWhereItIsWhenItStartsAtRest) {
  data::Scene scene = puck_scene();
  scene.start.vx_m_s = scene.start.vy_m_s = 0.0;
  const Trajectory run = simulate(scene);
  EXPECT_EQ(run.outcome, Outcome::at_rest);
  EXPECT_EQ(run.values.rows(), 101);
  EXPECT_EQ(column(run, "x_m")[100], 0.1);
}

data::Scene pivot_scene() {
  data::Scene scene;
  scene.body.emplace();
  scene.body->radius_m = 0.05;
  scene.support.kind = data::SupportKind::pivot;
  scene.start.w3_rad_s = 40.0;
  scene.run.until_s = 20.0;
  scene.run.rate_hz = 10.0;
  return scene;
}

// The closed form of the Riccati equation (pivot.md (3)): with
// y = exp(-t1 t/2) (cosh st + (t1/2 + t2 w0) sinh(st)/s), s^2 = t1^2/4 - t0 t2: psi = ln(y)/t2.
TEST(Pivot, FollowsTheClosedFormUntilItStops) {
  data::Scene scene = pivot_scene();
  const double t0 = 0.8, t1 = 0.15, t2 = 0.004;
  scene.model.spin_down_dry_rad_s2 = t0;
  scene.model.spin_down_viscous_1_s = t1;
  scene.model.spin_down_quadratic_1_rad = t2;
  const Trajectory run = simulate(scene);
  EXPECT_EQ(run.outcome, Outcome::at_rest);
  const double rest_s = run.events.at(0).t_s, s = std::sqrt(t1 * t1 / 4.0 - t0 * t2);
  const auto angle = [&](double t) {
    return std::log(std::exp(-t1 * t / 2.0) *
                    (std::cosh(s * t) + (t1 / 2.0 + t2 * 40.0) * std::sinh(s * t) / s)) /
           t2;
  };
  for (Eigen::Index n = 0; n < run.values.rows(); ++n)
    EXPECT_NEAR(column(run, "psi_rad")[n], angle(std::min(0.1 * static_cast<double>(n), rest_s)),
                kPivot_rad);
}

TEST(Pivot, StatesTheErrorOfItsSpinAngleAndNoneInMetres) {
  data::Scene scene = pivot_scene();
  scene.model.spin_down_dry_rad_s2 = 0.8;
  scene.model.spin_down_viscous_1_s = 0.15;
  scene.run.tolerance = 1e-5;
  const Trajectory run = simulate(scene);
  EXPECT_TRUE(std::isnan(run.error_estimate_m));
  EXPECT_GT(run.error_estimate_rad, 0.0);
}

TEST(Puck, StatesTheErrorOfItsSpinAngleToo) {
  data::Scene scene = puck_scene();
  scene.start.w3_rad_s = 30.0;
  scene.run.tolerance = 1e-5;
  const Trajectory run = simulate(scene);
  EXPECT_GT(run.error_estimate_m, 0.0);
  EXPECT_GT(run.error_estimate_rad, 0.0);
}

TEST(Pivot, StopsDryInTheParabolasTime) {
  data::Scene scene = pivot_scene();
  scene.model.spin_down_dry_rad_s2 = 4.0;
  scene.start.w3_rad_s = -40.0;
  const Trajectory run = simulate(scene);
  constexpr double kExact = 1e-12;  // a parabola is exact for the method: rounding is left
  EXPECT_NEAR(run.events.at(0).t_s, 10.0, kExact);
  EXPECT_NEAR(column(run, "psi_rad")[200], -200.0, 1000.0 * kExact);
}

TEST(Pivot, NeverStopsWithoutDryFriction) {
  data::Scene scene = pivot_scene();
  scene.model.spin_down_viscous_1_s = 2.0;
  const Trajectory run = simulate(scene);
  EXPECT_EQ(run.outcome, Outcome::reached_end);
  EXPECT_NEAR(column(run, "psi_rad")[200], 20.0, 10.0 * kPivot_rad);  // as it creeps to its limit
}

// The pendulum's period for an amplitude A is 4 K(sin(A/2))/omega; a body of known mass tells its
// energy.
TEST(Pivot, SwingsLikeAPendulumWithAWeightBesideItsAxis) {
  constexpr double kAmplitude_rad = 2.0, kGs = 9.0;
  constexpr double kEnergy = 1e-9;  // a hundred local errors of 1e-11
  data::Scene scene = pivot_scene();
  scene.body->mass_kg = 0.1;
  scene.body->thickness_m = 0.01;
  scene.model.spin_down_imbalance_sin_rad_s2 = kGs;
  scene.start.psi_rad = kAmplitude_rad;
  scene.start.w3_rad_s = 0.0;
  const double period_s = 4.0 * std::comp_ellint_1(std::sin(0.5 * kAmplitude_rad)) / std::sqrt(kGs);
  scene.run.rate_hz = 2.0 / period_s;
  scene.run.until_s = 5.0 * period_s;
  scene.run.tolerance = 1e-11;
  const Trajectory run = simulate(scene);
  EXPECT_EQ(run.outcome, Outcome::reached_end);
  for (Eigen::Index n = 0; n < run.values.rows(); ++n) {
    EXPECT_NEAR(column(run, "psi_rad")[n], n % 2 == 0 ? kAmplitude_rad : -kAmplitude_rad,
                kPivot_rad);
    EXPECT_NEAR(column(run, "energy_J")[n] / column(run, "energy_J")[0], 1.0, kEnergy);
  }
}

// Each half swing of a pendulum with dry friction loses d per radian, (5): psi_(n+1) solves
// Gs (cos psi_n - cos psi_(n+1)) = -d |psi_(n+1) - psi_n|; it stays where Gs |sin psi| <= d.
TEST(Pivot, StopsWhereDryFrictionHoldsTheWeight) {
  constexpr double kGs = 9.0, kDry = 0.7;
  data::Scene scene = pivot_scene();
  scene.model.spin_down_imbalance_sin_rad_s2 = kGs;
  scene.model.spin_down_dry_rad_s2 = kDry;
  scene.start.psi_rad = 1.2;
  scene.start.w3_rad_s = 0.0;
  scene.run.until_s = 60.0;
  const Trajectory run = simulate(scene);
  EXPECT_EQ(run.outcome, Outcome::at_rest);
  double at = 1.2;
  while (kGs * std::abs(std::sin(at)) > kDry) {
    const double sense = at > 0.0 ? -1.0 : 1.0;
    double near = at + 1e-3 * sense, far = sense * std::abs(at);  // brackets of the next turn
    for (int i = 0; i < 100; ++i) {
      const double middle = 0.5 * (near + far);
      const double energy = kGs * (std::cos(middle) - std::cos(at)) - kDry * std::abs(middle - at);
      (energy > 0.0 ? near : far) = middle;
    }
    at = near;
  }
  constexpr double kSwings = 10.0;  // each hands its error on to the next
  EXPECT_NEAR(column(run, "psi_rad")[run.values.rows() - 1], at, kSwings * kPivot_rad);
}

// dw/dt = -d/(1 + k w): w + k w^2/2 falls linearly in time.
TEST(Pivot, WeakensWithSpeedAsItsLawSays) {
  constexpr double kDry = 8.0, k = 0.05, w0 = 40.0;
  data::Scene scene = pivot_scene();
  scene.model.spin_down_dry_rad_s2 = kDry;
  scene.model.spin_down_weakening_s_rad = k;
  const Trajectory run = simulate(scene);
  const double whole = w0 + 0.5 * k * w0 * w0;
  constexpr double kStop_s = 1e-8;  // a hundred local errors, of a stop within ten seconds
  EXPECT_NEAR(run.events.at(0).t_s, whole / kDry, kStop_s);
  for (const Eigen::Index n : {20, 60, 90}) {
    const double w = column(run, "w3_rad_s")[n];
    const double expected = whole - kDry * 0.1 * static_cast<double>(n);
    EXPECT_NEAR(w + 0.5 * k * w * w, expected, 10.0 * kPivot_rad);  // rates of up to 80 rad/s
  }
}

TEST(Pivot, DifferentiatesByEveryParameter) {
  data::Scene scene = pivot_scene();
  scene.model.spin_down_dry_rad_s2 = 0.8;
  scene.model.spin_down_viscous_1_s = 0.15;
  scene.model.spin_down_quadratic_1_rad = 0.004;
  expect_derivatives(*make_predictor(scene), std::vector{0.5, 5.0, 30.0}, {Observable::psi_rad});
  scene.model.spin_down_weakening_s_rad = 0.02;
  scene.model.spin_down_imbalance_sin_rad_s2 = 9.0;
  scene.model.spin_down_imbalance_cos_rad_s2 = -4.0;
  scene.start.w3_rad_s = 8.0;
  // Turns over a few times, then swings back and forth, then rests.
  expect_derivatives(*make_predictor(scene), std::vector{0.5, 1.0, 3.0, 4.0, 5.0, 60.0},
                     {Observable::psi_rad});
}

// A disc that does not turn, and that nothing holds, turns by t for every radian per second.
TEST(Pivot, DifferentiatesWhereItStandsStillWithoutDryFriction) {
  data::Scene scene = pivot_scene();
  scene.start.w3_rad_s = 0.0;
  const auto predictor = make_predictor(scene);
  const std::vector<double> t_s{0.5, 3.0};
  PredictRequest request;
  request.t_s = t_s;
  request.observables = {Observable::psi_rad};
  request.derivatives = {predictor->index_of("w3_rad_s")};
  const Prediction run = predictor->predict(defaults(*predictor), request);
  constexpr double kRounding = 1e-12;
  EXPECT_NEAR(run.jacobian(0, 0), 0.5, kRounding);
  EXPECT_NEAR(run.jacobian(1, 0), 3.0, kRounding);
}

TEST(Pivot, NeedsDryFrictionForWeakening) {
  data::Scene scene = pivot_scene();
  scene.model.spin_down_weakening_s_rad = 0.1;
  EXPECT_THROW((void)simulate(scene), InputError);
}

}  // namespace
}  // namespace trochoid::model
