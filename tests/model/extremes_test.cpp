#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "common.hpp"
#include "quad.hpp"
#include "trochoid/model/free_body.hpp"
#include "trochoid/model/predictor.hpp"
#include "trochoid/model/simulate.hpp"
#include "trochoid/model/top.hpp"

// Where other programs go wrong, against quadruple precision: the same equations, but a hundred
// quadrillion times finer arithmetic and a tolerance of 1e-24.
namespace trochoid::model {
namespace {

struct Start {
  Quad a, b, gamma1, gamma3, theta, dtheta, dphi;
};

/// Axis k at ascending times.
std::vector<State<Quad, 3>> exact_axis(const Start& s, const std::vector<double>& t_s) {
  using System = TopWithDrag<Quad>;
  const auto start = axis_and_momentum<Quad>({s.theta, Quad(0.0), s.dtheta, s.dphi}, s.b);
  State<Quad, 7> y;
  const System system = System::at(s.a, s.b, s.gamma1, s.gamma3, start, y);
  StepControl<7> control = uniform_control<7>(1e-24);
  const double sine = std::hypot(value_of(start.k[0]), value_of(start.k[1]));
  for (double& atol : control.atol) atol *= std::max(sine, 1e-12);
  Taylor<System> stepper(system, control);
  stepper.start(0.0, y);
  std::vector<State<Quad, 3>> axis;
  for (const double t : t_s) {
    while (stepper.t_s() < t)
      if (stepper.step(t) != StepEnd::accepted) ADD_FAILURE() << "no exact run";
    axis.push_back({{stepper.y()[3], stepper.y()[4], stepper.y()[5]}});
  }
  return axis;
}

data::Scene top_scene(bool drag) {
  data::Scene scene;
  scene.model.name = "top";
  if (drag) scene.model.drag_transverse_N_m_s = scene.model.drag_spin_N_m_s = 1e-6;
  return scene;
}

struct Extreme {
  const char* name;
  double a, b, theta, dtheta, dphi, end_s;
  double allowed;  // largest error in x/l, y/l at tolerance 1e-13
};
class TopExtreme : public testing::TestWithParam<Extreme> {};

TEST_P(TopExtreme, StaysOnTheExactPath) {
  const Extreme& e = GetParam();
  std::vector<double> t_s;
  for (int n = 1; n <= 60; ++n) t_s.push_back(e.end_s * n / 60.0);
  const auto exact = exact_axis({e.a, e.b, 0.0, 0.0, e.theta, e.dtheta, e.dphi}, t_s);
  const auto predictor = make_predictor(top_scene(false));
  Eigen::VectorXd values(predictor->parameters().size());
  for (std::size_t i = 0; i < predictor->parameters().size(); ++i)
    values[static_cast<Eigen::Index>(i)] = predictor->parameters()[i].value;
  const auto set = [&](const char* name, double value) {
    values[predictor->index_of(name)] = value;
  };
  set("a_1_s2", e.a);
  set("b_1_s", e.b);
  set("l_m", 1.0);
  set("theta_rad", e.theta);
  set("phi_rad", 0.0);
  set("dtheta_rad_s", e.dtheta);
  set("dphi_rad_s", e.dphi);
  PredictRequest request;
  request.t_s = t_s;
  request.tolerance = 1e-13;
  const Prediction run = predictor->predict(values, request);
  ASSERT_EQ(run.outcome, Outcome::reached_end);
  double error = 0.0;
  for (std::size_t n = 0; n < t_s.size(); ++n) {
    for (int i = 0; i < 2; ++i)
      error = std::max(error, std::abs(run.values[2 * n + i] - value_of(exact[n][i])));
  }
  EXPECT_LT(error, e.allowed) << e.name << ", " << run.steps << " steps";
}

const double kThird = M_PI / 3.0;
INSTANTIATE_TEST_SUITE_P(
    Extremes, TopExtreme,
    testing::Values(Extreme{"base case", 0.098, 0.75, kThird, 0, 0, 60, 1e-12},
                    Extreme{"tilt 1e-6", 0.098, 0.75, 1e-6, 0, 0, 60, 1e-12},
                    Extreme{"unstable sleeper, tilt 1e-9", 0.098, 0.3, 1e-9, 0, 0, 60, 1e-9},
                    Extreme{"upright, no spin, tilt 1e-8", 0.098, 0.0, 1e-8, 0, 0, 60, 1e-12},
                    Extreme{"through the pole", 0.098, 0.75, kThird, 0, 0.75 / 1.5, 60, 1e-12},
                    Extreme{"spin 50", 0.098, 75, kThird, 0, 0, 15, 1e-11},
                    Extreme{"spin 500", 0.098, 750, kThird, 0, 0, 3, 1e-11},
                    Extreme{"gravity times 100", 9.8, 0.75, kThird, 0, 0, 20, 1e-11},
                    Extreme{"I/Is 1e-3", 98, 750, kThird, 0, 0, 2, 1e-11},
                    Extreme{"I/Is 1e3", 9.8e-5, 7.5e-4, kThird, 0, 0, 600, 1e-12},
                    Extreme{"hanging, through the bottom", 0.098, 0.0, 2.0, 0.1, 0.0, 60, 1e-11}),
    [](const auto& test) { return "Case" + std::to_string(test.index); });

/// Turning about the middle axis, disturbed: the body flips over again and again. What tells one
/// orbit from the next, 2T I2 - L^2, is of the order of the disturbance squared.
data::Scene near_separatrix(double disturbance_rad_s) {
  data::Scene scene;
  scene.model.name = "free";
  scene.start.theta_rad = 0.7;
  scene.start.moments_kg_m2 = Eigen::Vector3d(3.0, 2.0, 1.0);
  scene.start.w_body_rad_s = Eigen::Vector3d(disturbance_rad_s, 2.0, disturbance_rad_s);
  scene.run.until_s = 60.0;
  scene.run.rate_hz = 10.0;
  scene.run.tolerance = 1e-13;
  return scene;
}

/// Largest error of the body rates over the rows of the run.
double rate_error(const Trajectory& run, double disturbance_rad_s) {
  const auto body = FreeBody<Quad>::with_moments(Quad(3.0), Quad(2.0), Quad(1.0));
  StepControl<7> control = uniform_control<7>(1e-24);
  for (double& atol : control.atol) atol *= disturbance_rad_s;
  Taylor<FreeBody<Quad>> stepper(body, control);
  const Quad d(disturbance_rad_s);
  stepper.start(0.0, {{d, Quad(2.0), d, Quad(1.0), Quad(0.0), Quad(0.0), Quad(0.0)}});
  double error = 0.0;
  for (Eigen::Index n = 0; n < run.values.rows(); ++n) {
    while (stepper.t_s() < run.values(n, 0))
      if (stepper.step(run.values(n, 0)) != StepEnd::accepted) ADD_FAILURE() << "no exact run";
    for (int i = 0; i < 3; ++i)
      error = std::max(error, std::abs(run.values(n, 11 + i) - value_of(stepper.y()[i])));
  }
  return error;
}

TEST(FreeBodyExtreme, NearTheSeparatrixStaysOnTheExactPath) {
  const Trajectory run = simulate(near_separatrix(1e-4));
  ASSERT_EQ(run.outcome, Outcome::reached_end);
  EXPECT_LT(run.values.col(12).minCoeff(), -1.99);  // of -2 rad/s: it has flipped
  // Rounding of 1e-16 in 2T I2 - L^2 = 1e-8 moves the flips by 1e-8 of a growth time, each by as
  // much again.
  constexpr double kOfSomeFlips = 1e-6;
  EXPECT_LT(rate_error(run, 1e-4), kOfSomeFlips);
}

// Disturbed by 1e-9 the difference is 1e-18: no double-precision run can know when the second flip
// comes. It must say so, and show nothing beyond.
TEST(FreeBodyExtreme, AtTheSeparatrixTheRunEndsWhereItIsNoLongerKnown) {
  const Trajectory run = simulate(near_separatrix(1e-9));
  EXPECT_EQ(run.outcome, Outcome::diverged);
  EXPECT_LT(run.end_s, 60.0);
  EXPECT_GT(run.end_s, 10.0);
  constexpr double kWithinAFlip_rad_s = 0.3;  // of 2: the rates are not those of another flip
  EXPECT_LT(rate_error(run, 1e-9), kWithinAFlip_rad_s);
}

// Derivatives against central differences of quadruple-precision runs: with h = 1e-9 their own
// error is 1e-18 (truncation) and 1e-17 (rounding), so what is seen is ours.
TEST(TopDerivatives, AgreeWithQuadruplePrecisionDifferences) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  const auto predictor = make_predictor(top_scene(true));
  const char* names[] = {"a_1_s2",    "b_1_s",        "gamma1_1_s", "gamma3_1_s",
                         "theta_rad", "dtheta_rad_s", "dphi_rad_s"};
  for (int draw = 0; draw < 4; ++draw) {
    const double b = std::exp(3.0 * unit(random));
    const double at[7] = {b * b * (0.02 + 0.7 * unit(random)),
                          b,
                          0.02 * b * unit(random),
                          0.02 * b * unit(random),
                          0.25 + unit(random),
                          0.2 * b * (unit(random) - 0.5),
                          0.2 * b * (unit(random) - 0.5)};
    std::vector<double> t_s;
    for (int n = 1; n <= 20; ++n) t_s.push_back(12.0 / b * n / 20.0);
    Eigen::VectorXd values(predictor->parameters().size());
    for (std::size_t i = 0; i < predictor->parameters().size(); ++i)
      values[static_cast<Eigen::Index>(i)] = predictor->parameters()[i].value;
    values[predictor->index_of("l_m")] = 1.0;
    values[predictor->index_of("phi_rad")] = 0.0;
    PredictRequest request;
    request.t_s = t_s;
    request.tolerance = 1e-13;
    for (int i = 0; i < 7; ++i) {
      values[predictor->index_of(names[i])] = at[i];
      request.derivatives.push_back(predictor->index_of(names[i]));
    }
    const Prediction run = predictor->predict(values, request);
    for (int i = 0; i < 7; ++i) {
      const auto shifted = [&](double by) {
        Quad p[7];
        for (int j = 0; j < 7; ++j) p[j] = Quad(at[j]);
        p[i] += Quad(by);
        return exact_axis({p[0], p[1], p[2], p[3], p[4], p[5], p[6]}, t_s);
      };
      const double h = 1e-4 * std::max(std::abs(at[i]), 0.1);
      const auto above = shifted(h), below = shifted(-h), far_above = shifted(2 * h),
                 far_below = shifted(-2 * h);
      const double largest = run.jacobian.col(i).cwiseAbs().maxCoeff();
      for (std::size_t n = 0; n < t_s.size(); ++n) {
        for (int c = 0; c < 2; ++c) {
          const Quad near = above[n][c] - below[n][c], far = far_above[n][c] - far_below[n][c];
          const double exact = value_of((Quad(8.0) * near - far) / Quad(12.0 * h));
          EXPECT_NEAR(run.jacobian(2 * n + c, i), exact, 1e-11 * (1.0 + largest))
              << names[i] << ", draw " << draw;
        }
      }
    }
  }
}

TEST(TopExtremes, ASleepingTopStaysAsleepAndItsAnglesAreNumbers) {
  data::Scene scene;
  scene.model.name = "top";
  data::Body body;
  body.kind = data::BodyKind::top;
  body.mass_kg = 0.1;
  body.I_kg_m2 = 1.0;
  body.Is_kg_m2 = 1.5;
  body.l_m = 0.1;
  scene.body = body;
  scene.start.theta_rad = 0.0;
  scene.start.omega_s_rad_s = 2.0;
  for (const double theta : {0.0, M_PI}) {
    scene.start.theta_rad = theta;
    const Trajectory run = simulate(scene);
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_TRUE(run.values.allFinite()) << theta;
    constexpr double kRounding = 1e-12;  // of an equilibrium
    EXPECT_LT((run.values.col(2).array() - theta).abs().maxCoeff(), kRounding);
  }
}

// At the pole there is no azimuth; all else is told, and the tilt one-sidedly.
TEST(TopExtremes, ASleepingTopsPredictionHoldsNothingButNumbers) {
  constexpr Observable kEverything[] = {Observable::x_m, Observable::theta_rad, Observable::phi_rad,
                                        Observable::psi_rad};
  for (const double theta : {0.0, 1e-300}) {
    data::Scene scene;
    scene.model.name = "top";
    scene.start.theta_rad = theta;
    const auto predictor = make_predictor(scene);
    const std::vector<double> t_s{0.0, 0.5};
    PredictRequest request;
    request.t_s = t_s;
    request.observables.assign(std::begin(kEverything), std::end(kEverything));
    request.want_end_state = true;
    for (std::size_t i = 0; i < predictor->parameters().size(); ++i)
      request.derivatives.push_back(static_cast<int>(i));
    const Prediction run = predictor->predict(defaults(*predictor), request);
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_TRUE(run.values.allFinite());
    EXPECT_TRUE(run.jacobian.allFinite());
    EXPECT_TRUE(run.end_state.allFinite()) << run.end_state.transpose();
    EXPECT_TRUE(run.end_state_jacobian.allFinite());
    constexpr int kTheta = 1;  // the second observable at the start
    EXPECT_EQ(run.jacobian(kTheta, predictor->index_of("theta_rad")), 1.0);
  }
}

}  // namespace
}  // namespace trochoid::model
