#include "trochoid/model/dormand_prince.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "trochoid/model/events.hpp"

namespace trochoid::model {
namespace {

template <class T>
struct Oscillator {
  using Scalar = T;
  static constexpr int kStates = 2;
  static constexpr int kEvents = 1;
  T stiffness;
  void derivative(double, const State<T, 2>& y, State<T, 2>& dy) const {
    dy[0] = y[1];
    dy[1] = -stiffness * y[0];
  }
  void events(double, const State<T, 2>& y, State<T, 1>& g) const { g[0] = y[0]; }
  Oscillator<double> values() const { return {value_of(stiffness)}; }
};

/// A ball on a floor: free fall, event at height zero.
template <class T>
struct Ball {
  using Scalar = T;
  static constexpr int kStates = 2;
  static constexpr int kEvents = 1;
  T gravity;
  void derivative(double, const State<T, 2>& y, State<T, 2>& dy) const {
    dy[0] = y[1];
    dy[1] = -gravity;
  }
  void events(double, const State<T, 2>& y, State<T, 1>& g) const { g[0] = y[0]; }
  Ball<double> values() const { return {value_of(gravity)}; }
};

struct Blowup {
  using Scalar = double;
  static constexpr int kStates = 1;
  void derivative(double, const State<double, 1>& y, State<double, 1>& dy) const {
    dy[0] = y[0] * y[0];
  }
};

// The tableau is data: a wrong digit shows in the order conditions sum_j b_j c_j^(q-1) = 1/q and in
// the row sums. Coefficients carry about 1e-16 each, sums of 12 of size up to 25.
TEST(DormandPrinceTableau, MeetsItsQuadratureConditions) {
  constexpr double kRounding = 2e-14;
  for (int q = 1; q <= 8; ++q) {
    double sum = 0.0;
    for (int j = 0; j < dop853::kStages; ++j)
      sum += dop853::kA[12][j] * std::pow(dop853::kC[j], q - 1);
    EXPECT_NEAR(sum, 1.0 / q, kRounding) << "order " << q;
  }
  for (int row = 1; row < dop853::kAllStages; ++row) {
    double sum = 0.0;
    for (int j = 0; j < row; ++j) sum += dop853::kA[row][j];
    EXPECT_NEAR(sum, dop853::kC[row], kRounding) << "row " << row;
  }
}

TEST(DormandPrince, FollowsTheHarmonicOscillatorAlsoBetweenSteps) {
  std::vector<double> t_s;
  for (int n = 0; n <= 1000; ++n) t_s.push_back(0.02 * n);
  std::vector<double> y(t_s.size());
  for (const double tolerance : {1e-6, 1e-9, 1e-12}) {
    DormandPrince<Oscillator<double>> stepper({4.0}, uniform_control<2>(tolerance));
    stepper.start(0.0, {{1.0, 0.0}});
    const EventRule report_only{.direction = 0, .terminal = false};
    const auto run = integrate(
        stepper, 20.0, t_s.data(), static_cast<int>(t_s.size()),
        [&](const auto& step, int first, int last) {
          for (int n = first; n < last; ++n) y[n] = step.dense(0, step.fraction(t_s[n]));
        },
        1u, &report_only);
    EXPECT_EQ(run.end, RunEnd::reached_end);
    // 6.4 periods: local errors add up; each step is allowed one tolerance.
    const double allowed = 2.0 * tolerance * stepper.counts().steps;
    for (std::size_t n = 0; n < t_s.size(); ++n)
      ASSERT_NEAR(y[n], std::cos(2.0 * t_s[n]), allowed) << "t = " << t_s[n];
  }
}

TEST(DormandPrince, ConvergesWithItsOrder) {
  const auto error_with_steps = [](int steps) {
    StepControl<2> control = uniform_control<2>(1e3);  // never rejects: fixed steps
    control.max_step_s = control.first_step_s = 4.0 / steps;
    DormandPrince<Oscillator<double>> stepper({1.0}, control);
    stepper.start(0.0, {{1.0, 0.0}});
    while (stepper.t_s() < 4.0) EXPECT_EQ(stepper.step(4.0), StepEnd::accepted);
    return std::abs(stepper.y()[0] - std::cos(4.0));
  };
  const double order = std::log2(error_with_steps(4) / error_with_steps(8));
  EXPECT_GT(order, 7.5);  // 8 as steps get short
}

TEST(DormandPrince, CarriesExactDerivatives) {
  using D = Dual<4>;
  DormandPrince<Oscillator<D>> stepper({D::variable(4.0, 0)}, uniform_control<2>(1e-12));
  stepper.start(0.0, {{D::variable(1.5, 1), D::variable(0.3, 2)}});
  while (stepper.t_s() < 5.0) ASSERT_EQ(stepper.step(5.0), StepEnd::accepted);
  // x = x0 cos(w t) + v0/w sin(w t), w = sqrt(k) = 2
  const double c = std::cos(10.0), s = std::sin(10.0);
  const double by_w = -1.5 * 5.0 * s + 0.3 * (5.0 * c / 2.0 - s / 4.0);
  constexpr double kAllowed = 1e-9;  // tolerance 1e-12 over some 40 steps, derivatives grow with t
  EXPECT_NEAR(stepper.y()[0].derivative[0], by_w / 4.0, kAllowed);
  EXPECT_NEAR(stepper.y()[0].derivative[1], c, kAllowed);
  EXPECT_NEAR(stepper.y()[0].derivative[2], s / 2.0, kAllowed);
  EXPECT_EQ(stepper.y()[0].derivative[3], 0.0);
}

TEST(Events, AreFoundOnTheDenseOutputInTheWantedDirection) {
  DormandPrince<Oscillator<double>> stepper({1.0}, uniform_control<2>(1e-12));
  stepper.start(0.0, {{1.0, 0.0}});
  std::vector<double> found;
  const EventRule rising{.direction = +1, .terminal = false};
  (void)integrate(
      stepper, 30.0, nullptr, 0, [](const auto&, int, int) {}, 0u, &rising, -1,
      [&](int, double t) { found.push_back(t); });
  ASSERT_EQ(found.size(), 5u);
  constexpr double kAllowed_s = 1e-10;  // tolerance 1e-12 over 30 s
  for (int i = 0; i < 5; ++i) EXPECT_NEAR(found[i], (2.0 * i + 1.5) * M_PI, kAllowed_s);
}

TEST(Events, ADipThatStaysBetweenTwoSamplesIsSeen) {
  // cos(t) - 0.999 is positive for |t| < 0.0447 only: shorter than a step.
  struct Dip : Oscillator<double> {
    void events(double, const State<double, 2>& y, State<double, 1>& g) const {
      g[0] = y[0] - 0.999;
    }
  };
  DormandPrince<Dip> stepper(Dip{{1.0}}, uniform_control<2>(1e-10));
  stepper.start(0.0, {{0.0, -1.0}});  // -sin t: top at 3 pi / 2
  const auto run = integrate(
      stepper, 6.0, nullptr, 0, [](const auto&, int, int) {}, 0u);
  ASSERT_EQ(run.end, RunEnd::event);
  constexpr double kAllowed_s = 1e-8;  // tolerance 1e-10 over a slope of 0.045, of some steps
  EXPECT_NEAR(run.t_s, 1.5 * M_PI - std::acos(0.999), kAllowed_s);
}

// One step from 0 to 1 along y = t: where it is looked at is known.
struct Clock {
  using Scalar = double;
  static constexpr int kStates = 1;
  void derivative(double, const State<double, 1>&, State<double, 1>& dy) const { dy[0] = 1.0; }
};
/// Below zero for 0.02 about `at`.
struct Dipping : Clock {
  static constexpr int kEvents = 1;
  double at = 0.0;
  void events(double, const State<double, 1>& y, State<double, 1>& g) const {
    g[0] = (y[0] - at) * (y[0] - at) - 1e-4;
  }
};
/// A dip from 0.19 on, and a crossing at 0.22.
struct DippingAndFalling : Clock {
  static constexpr int kEvents = 2;
  void events(double, const State<double, 1>& y, State<double, 2>& g) const {
    g[0] = (y[0] - 0.2) * (y[0] - 0.2) - 1e-4;
    g[1] = 0.22 - y[0];
  }
};
template <class System>
RunResult<System> in_one_step(const System& system) {
  StepControl<1> control = uniform_control<1>(1e-10);
  control.first_step_s = 1.0;
  DormandPrince<System> stepper(system, control);
  stepper.start(0.0, {{0.0}});
  return integrate(
      stepper, 1.0, nullptr, 0, [](const auto&, int, int) {}, 0u);
}

TEST(Events, ADipNextToTheEndOfAStepIsSeen) {
  for (const double at : {0.02, 0.06, 0.11, 0.3, 0.5, 0.7, 0.9, 0.96, 0.985}) {
    Dipping dip;
    dip.at = at;
    const auto run = in_one_step(dip);
    ASSERT_EQ(run.end, RunEnd::event) << at;
    constexpr double kRounding_s = 1e-12;
    EXPECT_NEAR(run.t_s, at - 0.01, kRounding_s);
  }
}

TEST(Events, ADipBeforeTheCrossingOfAnotherEventComesFirst) {
  const auto run = in_one_step(DippingAndFalling{});
  ASSERT_EQ(run.end, RunEnd::event);
  EXPECT_EQ(run.event, 0);
}

// Height h, restitution e: after the first bounce at t1 = sqrt(2h/g) the ball is at
// e g t1 (t - t1) - g (t - t1)^2 / 2. The derivatives by h, g and e need the saltation terms.
TEST(Events, DerivativesCrossABounce) {
  using D = Dual<4>;
  const double h = 1.3, g = 9.81, e = 0.8, t_end = 0.9;
  const D restitution = D::variable(e, 2);
  Ball<D> ball{D::variable(g, 1)};
  DormandPrince<Ball<D>> stepper(ball, uniform_control<2>(1e-12));
  stepper.start(0.0, {{D::variable(h, 0), D(0.0)}});
  const auto none = [](const auto&, int, int) {};
  const auto run = integrate(stepper, t_end, nullptr, 0, none, 0u);
  ASSERT_EQ(run.end, RunEnd::event);
  State<D, 1> gap;
  ball.events(run.t_s, run.y, gap);
  const D delay = event_delay(gap[0], run.event_rate);
  const auto y = across_event(ball, ball, run.t_s, run.y, delay, [&](State<D, 2> before) {
    before[1] = -restitution * before[1];
    return before;
  });
  stepper.start(run.t_s, y);
  const auto rest = integrate(stepper, t_end, nullptr, 0, none, 0u, nullptr, 0);
  ASSERT_EQ(rest.end, RunEnd::reached_end);
  const auto height = [&](double h_, double g_, double e_) {
    const double t1 = std::sqrt(2.0 * h_ / g_), s = t_end - t1;
    return e_ * g_ * t1 * s - 0.5 * g_ * s * s;
  };
  const double d = 1e-5;  // central differences of a closed form: error d^2, about 1e-9
  constexpr double kValue = 1e-11, kSlope = 1e-8;  // a parabola is exact; of the differences
  EXPECT_NEAR(rest.y[0].value, height(h, g, e), kValue);
  EXPECT_NEAR(rest.y[0].derivative[0], (height(h + d, g, e) - height(h - d, g, e)) / (2 * d),
              kSlope);
  EXPECT_NEAR(rest.y[0].derivative[1], (height(h, g + d, e) - height(h, g - d, e)) / (2 * d),
              kSlope);
  EXPECT_NEAR(rest.y[0].derivative[2], (height(h, g, e + d) - height(h, g, e - d)) / (2 * d),
              kSlope);
}

TEST(DormandPrince, NamesAFiniteTimeBlowupInsteadOfReturningNumbers) {
  DormandPrince<Blowup> stepper({}, uniform_control<1>(1e-10));
  stepper.start(0.0, {{1.0}});  // 1/(1-t)
  const auto run = integrate(
      stepper, 2.0, nullptr, 0, [](const auto&, int, int) {}, 0u);
  EXPECT_NE(run.end, RunEnd::reached_end);
  constexpr double kPastPole_s = 1e-6;  // errors of the steps before it move the pole
  EXPECT_LE(run.t_s, 1.0 + kPastPole_s);
}

}  // namespace
}  // namespace trochoid::model
