#include "trochoid/model/sundials.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "trochoid/data/error.hpp"

namespace trochoid::model {
namespace {

// y'' = -y from (1, 0): y = cos t.
template <class S>
struct UndampedOscillator {
  using Scalar = S;
  static constexpr int kStates = 2;
  void derivative(double, const State<S, 2>& y, State<S, 2>& dy) const {
    dy[0] = y[1];
    dy[1] = -y[0];
  }
  [[nodiscard]] UndampedOscillator<double> values() const { return {}; }
};

SundialsOptions options(SundialsMethod method, double tolerance) {
  SundialsOptions result;
  result.method = method;
  result.rtol = tolerance;
  result.atol = Eigen::VectorXd::Constant(2, tolerance);
  return result;
}

// Local errors are controlled; over a few hundred steps they add up.
constexpr double kAddedUp = 1000.0;

class EveryMethod : public testing::TestWithParam<SundialsMethod> {};

TEST_P(EveryMethod, FollowsTheCosine) {
  const std::array<double, 3> times{0.0, 1.0, 5.0};
  const double tolerance = 1e-9;
  const SundialsRun run =
      integrate_sundials(make_ode(UndampedOscillator<Dual<4>>{}), 0.0, Eigen::Vector2d(1.0, 0.0),
                         times, options(GetParam(), tolerance));
  ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
  ASSERT_EQ(run.states.rows(), 3);
  const double allowed = kAddedUp * tolerance;
  for (int i = 0; i < 3; ++i)
    EXPECT_NEAR(run.states(i, 0), std::cos(times[static_cast<std::size_t>(i)]), allowed);
}

TEST_P(EveryMethod, StopsAtAnEventAndNamesIt) {
  Ode ode = make_ode(UndampedOscillator<Dual<4>>{});
  ode.events = 2;
  ode.event_functions = [](double, const double* y, double* g) {
    g[0] = y[0] + 10.0;  // never
    g[1] = y[0];         // at pi/2
  };
  constexpr double kTolerance = 1e-10;
  const std::array<double, 2> times{1.0, 5.0};
  const SundialsRun run = integrate_sundials(ode, 0.0, Eigen::Vector2d(1.0, 0.0), times,
                                             options(GetParam(), kTolerance));
  EXPECT_EQ(run.event, 1);
  EXPECT_EQ(run.states.rows(), 1);
  EXPECT_NEAR(run.end_s, 0.5 * M_PI, kAddedUp * kTolerance);
}

// y' = -1 from 1: nothing at 0.5 s, which is asked for.
template <class S>
struct Descent {
  using Scalar = S;
  static constexpr int kStates = 1;
  void derivative(double, const State<S, 1>&, State<S, 1>& dy) const { dy[0] = S(-1.0); }
  [[nodiscard]] Descent<double> values() const { return {}; }
};

TEST_P(EveryMethod, StopsAtAnEventRightWhereATimeIsAskedFor) {
  Ode ode = make_ode(Descent<Dual<4>>{});
  ode.events = 1;
  ode.event_functions = [](double, const double* y, double* g) { g[0] = y[0] - 0.5; };
  const std::array<double, 5> times{0.0, 0.25, 0.5, 0.75, 1.0};
  constexpr double kTolerance = 1e-8, kAFew = 10.0;  // the line is exact but for the first steps
  SundialsOptions own = options(GetParam(), kTolerance);
  own.atol.conservativeResize(1);
  const SundialsRun run = integrate_sundials(ode, 0.0, Eigen::VectorXd::Ones(1), times, own);
  EXPECT_EQ(run.event, 0);
  EXPECT_LE(run.states.rows(), 3);
  EXPECT_NEAR(run.end_s, 0.5, kAFew * kTolerance);
}

INSTANTIATE_TEST_SUITE_P(Sundials, EveryMethod,
                         testing::Values(SundialsMethod::cvode_adams, SundialsMethod::cvode_bdf,
                                         SundialsMethod::arkode_erk, SundialsMethod::arkode_dirk));

TEST(Sundials, FollowsAStiffDecayInFewStepsWithTheExactJacobian) {
  Ode ode;
  ode.states = 1;
  ode.derivative = [](double t, const double* y, double* dy) {
    dy[0] = -1e6 * (y[0] - std::sin(t)) + std::cos(t);
  };
  ode.jacobian = [](double, const double*, double* j) { j[0] = -1e6; };
  SundialsOptions stiff;
  stiff.rtol = 1e-8;
  stiff.atol = Eigen::VectorXd::Constant(1, 1e-10);
  const std::array<double, 1> times{3.0};
  const SundialsRun run =
      integrate_sundials(ode, 0.0, Eigen::VectorXd::Constant(1, 1.0), times, stiff);
  EXPECT_NEAR(run.states(0, 0), std::sin(3.0), 0.1 * kAddedUp * stiff.rtol);  // few steps
  EXPECT_LT(run.steps, 5000);  // an explicit method needs 1e6 of them for stability alone
}

TEST(Sundials, CarriesExactSensitivitiesThroughAStiffRelaxation) {
  // y' = -k (y - a t), y(0) = y0:  y = a t - a/k + (y0 + a/k) exp(-k t); parameters a and k.
  const double a = 2.0, k = 300.0;
  Ode ode;
  ode.states = 1;
  ode.derivative = [=](double t, const double* y, double* dy) { dy[0] = -k * (y[0] - a * t); };
  ode.jacobian = [=](double, const double*, double* j) { j[0] = -k; };
  ode.sensitivities.start = Eigen::MatrixXd::Zero(1, 2);
  ode.sensitivities.derivative = [=](double t, const double* y, const double* s, double* ds) {
    ds[0] = -k * s[0] + k * t;
    ds[1] = -k * s[1] - (y[0] - a * t);
  };
  SundialsOptions stiff = options(SundialsMethod::cvode_bdf, 1e-10);
  stiff.atol = Eigen::VectorXd::Constant(1, 1e-12);
  const std::array<double, 2> times{0.0, 0.5};
  const SundialsRun run =
      integrate_sundials(ode, 0.0, Eigen::VectorXd::Constant(1, 1.0), times, stiff);
  ASSERT_EQ(run.sensitivities.rows(), 2);
  EXPECT_EQ(run.sensitivities(0, 0), 0.0);
  const double decay = std::exp(-k * 0.5);  // 1e-65: nothing of the start is left
  ASSERT_LT(decay, 1e-60);
  // Local errors of some hundred steps at 1e-10 of values below 1.
  EXPECT_NEAR(run.sensitivities(1, 0), 0.5 - 1.0 / k, 1e-8);
  EXPECT_NEAR(run.sensitivities(1, 1), a / (k * k), 1e-8 * a / (k * k) + 1e-10);

  stiff.method = SundialsMethod::cvode_adams;
  EXPECT_THROW((void)integrate_sundials(ode, 0.0, Eigen::VectorXd::Constant(1, 1.0), times, stiff),
               InputError);
}

TEST(Sundials, NamesTheStepLimitInsteadOfGoingOnForEver) {
  SundialsOptions few = options(SundialsMethod::cvode_adams, 1e-12);
  few.max_steps = 3;
  const std::array<double, 1> times{100.0};
  const SundialsRun run = integrate_sundials(make_ode(UndampedOscillator<Dual<4>>{}), 0.0,
                                             Eigen::Vector2d(1.0, 0.0), times, few);
  EXPECT_EQ(run.outcome, Outcome::step_limit);
  EXPECT_EQ(run.states.rows(), 0);
}

TEST(Sundials, EndsWithAReasonAtAPole) {
  Ode ode;
  ode.states = 1;
  ode.derivative = [](double, const double* y, double* dy) { dy[0] = y[0] * y[0]; };  // 1/(1 - t)
  SundialsOptions chosen;
  chosen.method = SundialsMethod::cvode_adams;
  chosen.max_steps = 100000;
  chosen.atol = Eigen::VectorXd::Constant(1, 1e-10);
  const std::array<double, 2> times{0.5, 2.0};
  const SundialsRun run =
      integrate_sundials(ode, 0.0, Eigen::VectorXd::Constant(1, 1.0), times, chosen);
  EXPECT_NE(run.outcome, Outcome::reached_end);
  EXPECT_FALSE(run.message.empty());
  EXPECT_NEAR(run.states(0, 0), 2.0, kAddedUp * 10.0 * chosen.rtol);  // growing as y does
}

TEST(Sundials, RefusesTolerancesThatDoNotMatchTheStates) {
  SundialsOptions wrong = options(SundialsMethod::cvode_bdf, 1e-8);
  wrong.atol.resize(1);
  const std::array<double, 1> times{1.0};
  EXPECT_THROW((void)integrate_sundials(make_ode(UndampedOscillator<Dual<4>>{}), 0.0,
                                        Eigen::Vector2d(1.0, 0.0), times, wrong),
               InputError);
}

}  // namespace
}  // namespace trochoid::model
