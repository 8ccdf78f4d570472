#include "trochoid/model/radau.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <complex>
#include <vector>

#include "reference_cases.hpp"
#include "rim_kernel.hpp"
#include "trochoid/model/events.hpp"
#include "trochoid/model/sundials.hpp"

namespace trochoid::model {
namespace {

constexpr double kRoundingOfSums = 1e-14;  // of a few dozen operations on numbers of order 1

/// v' = -k (v - sin a t) + a cos a t, (IV.15.1) of [HairerWanner1996], and the way it makes:
/// v = sin a t + v(0) exp(-k t),  x = (1 - cos a t)/a + v(0) (1 - exp(-k t))/k.
template <class T>
struct Relaxation {
  using Scalar = T;
  static constexpr int kStates = 2;
  static constexpr int kEvents = 1;
  T rate, turning;
  void derivative(double t, const State<T, 2>& y, State<T, 2>& dy) const {
    dy[0] = -rate * (y[0] - sin(turning * t)) + turning * cos(turning * t);
    dy[1] = y[0];
  }
  void events(double, const State<T, 2>& y, State<T, 1>& g) const { g[0] = y[1] - 0.5; }
  Relaxation<double> values() const { return {value_of(rate), value_of(turning)}; }
};

template <class System>
Radau<System> radau_for(const System& system, double tolerance) {
  return {system, Radau<System>::loosened(uniform_control<System::kStates>(tolerance))};
}

/// A state grows without bound in finite time.
struct Explosion {
  using Scalar = double;
  static constexpr int kStates = 1;
  void derivative(double, const State<double, 1>& y, State<double, 1>& dy) const {
    dy[0] = y[0] * y[0];
  }
};

// The numbers are data: those of the method follow from its nodes, as collocation, and those of the
// transformation have to make its inverse block diagonal. Rounded as printed, to some 1e-15.
TEST(RadauCoefficients, TransformTheCollocationMethodOfTheirNodes) {
  const double c[3] = {radau::kC1, radau::kC2, 1.0};
  Eigen::Matrix3d powers, integrals;  // sum_j a_ij c_j^(q-1) = c_i^q / q
  for (int i = 0; i < 3; ++i)
    for (int q = 1; q <= 3; ++q) {
      powers(i, q - 1) = std::pow(c[i], q - 1);
      integrals(i, q - 1) = std::pow(c[i], q) / q;
    }
  const Eigen::Matrix3d method = integrals * powers.inverse();
  // Radau nodes: with the last row as weights exact up to order 5.
  for (int q = 1; q <= 5; ++q) {
    double sum = 0.0;
    for (int j = 0; j < 3; ++j) sum += method(2, j) * std::pow(c[j], q - 1);
    EXPECT_NEAR(sum, 1.0 / q, kRoundingOfSums) << "order " << q;
  }
  Eigen::Matrix3d forth, back;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) forth(i, j) = radau::kT[i][j], back(i, j) = radau::kInverseT[i][j];
  EXPECT_LT((forth * back - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff(), kRoundingOfSums);
  Eigen::Matrix3d blocks = Eigen::Matrix3d::Zero();
  blocks(0, 0) = radau::kReal;
  blocks.bottomRightCorner<2, 2>() << radau::kRe, -radau::kIm, radau::kIm, radau::kRe;
  constexpr double kInverted = 10.0 * kRoundingOfSums;  // the method's condition costs a digit
  EXPECT_LT((back * method.inverse() * forth - blocks).cwiseAbs().maxCoeff(), kInverted);
}

TEST(SmallLu, SolvesRealAndComplexSystemsThatNeedPivots) {
  const double real[3][3] = {{0.0, 2.0, 1.0}, {1e-14, 1.0, 4.0}, {3.0, -1.0, 0.5}};
  SmallLu<double, 3> lu;
  ASSERT_TRUE(lu.factorise(real));
  State<double, 3> x{{3.0, -1.0, 2.0}};
  RealSide<double, 3> side{x};
  lu.solve(side);
  const double b[3] = {3.0, -1.0, 2.0};
  for (int i = 0; i < 3; ++i)
    EXPECT_NEAR(real[i][0] * x[0] + real[i][1] * x[1] + real[i][2] * x[2], b[i], kRoundingOfSums);

  const Complex complex[2][2] = {{{0.0, 0.0}, {1.0, 2.0}}, {{2.0, -1.0}, {0.5, 0.0}}};
  SmallLu<Complex, 2> wide;
  ASSERT_TRUE(wide.factorise(complex));
  State<double, 2> re{{1.0, 0.0}}, im{{0.0, 3.0}};
  ComplexSide<double, 2> pair{re, im};
  wide.solve(pair);
  for (int i = 0; i < 2; ++i) {
    std::complex<double> sum;
    for (int j = 0; j < 2; ++j)
      sum += std::complex(complex[i][j].re, complex[i][j].im) * std::complex(re[j], im[j]);
    EXPECT_LT(std::abs(sum - (i == 0 ? std::complex(1.0, 0.0) : std::complex(0.0, 3.0))),
              kRoundingOfSums);
  }

  const double singular[2][2] = {{1.0, 2.0}, {2.0, 4.0}};
  SmallLu<double, 2> none;
  EXPECT_FALSE(none.factorise(singular));
  const double endless[2][2] = {{INFINITY, 0.0}, {0.0, 1.0}};
  EXPECT_FALSE(none.factorise(endless));
}

TEST(Radau, FollowsAStiffRelaxationInFewStepsAlsoBetweenThem) {
  const double rate = 1e6, turning = 2.0, start = 0.3;
  for (const double tolerance : {1e-4, 1e-6, 1e-8}) {
    auto stepper = radau_for(Relaxation<double>{rate, turning}, tolerance);
    stepper.start(0.0, {{start, 0.0}});
    std::vector<double> t_s;
    for (int n = 1; n <= 300; ++n) t_s.push_back(0.01 * n);
    double worst = 0.0;
    const EventRule report_only{.direction = 0, .terminal = false};
    const auto run = integrate(
        stepper, 3.0, t_s.data(), static_cast<int>(t_s.size()),
        [&](const auto& step, int first, int last) {
          for (int n = first; n < last; ++n) {
            const double way = (1.0 - std::cos(turning * t_s[n])) / turning + start / rate;
            worst = std::max(worst, std::abs(step.dense(1, step.fraction(t_s[n])) - way));
          }
        },
        2u, &report_only);
    ASSERT_EQ(run.end, RunEnd::reached_end);
    EXPECT_LT(worst, 10.0 * tolerance);
    // Of stiff components the method has a lower order [HairerWanner1996].
    EXPECT_NEAR(run.y[0], std::sin(3.0 * turning), 100.0 * tolerance);
    EXPECT_LT(stepper.counts().steps, 600) << "stability alone asks an explicit method for 5e5";
  }
}

TEST(Radau, DifferentiatesAsExactlyAsItIntegrates) {
  using D = Dual<4>;
  const double k = 300.0, a = 2.0, start = 0.7, end_s = 0.02;  // exp(-6): the start still shows
  constexpr double kTolerance = 1e-9, kAllowed = 10.0 * kTolerance;  // of a few steps together
  auto stepper = radau_for(Relaxation<D>{D::variable(k, 0), D::variable(a, 1)}, kTolerance);
  stepper.start(0.0, {{D::variable(start, 2), D(0.0)}});
  while (stepper.t_s() < end_s) ASSERT_EQ(stepper.step(end_s), StepEnd::accepted);
  const double decay = std::exp(-k * end_s);
  const D v = stepper.y()[0], x = stepper.y()[1];
  EXPECT_NEAR(v.value, std::sin(a * end_s) + start * decay, kAllowed);
  EXPECT_NEAR(v.derivative[0], -end_s * start * decay, kAllowed * end_s);
  EXPECT_NEAR(v.derivative[1], end_s * std::cos(a * end_s), kAllowed);
  EXPECT_NEAR(v.derivative[2], decay, kAllowed);
  EXPECT_NEAR(x.derivative[2], (1.0 - decay) / k, kTolerance);

  // The values are those of a run without derivatives, to rounding.
  auto plain = radau_for(Relaxation<double>{k, a}, kTolerance);
  plain.start(0.0, {{start, 0.0}});
  while (plain.t_s() < end_s) ASSERT_EQ(plain.step(end_s), StepEnd::accepted);
  EXPECT_EQ(plain.counts().steps, stepper.counts().steps);
  EXPECT_NEAR(plain.y()[0], v.value, kRoundingOfSums);
}

TEST(Radau, StopsOnAnEvent) {
  auto stepper = radau_for(Relaxation<double>{1e5, 1.0}, 1e-9);
  stepper.start(0.0, {{0.0, 0.0}});
  const auto run = integrate(stepper, 3.0, nullptr, 0, [](const auto&, int, int) {});
  ASSERT_EQ(run.end, RunEnd::event);
  // Between steps the collocation polynomial is of order 3 where the steps are of order 5, and its
  // slope is of order 2.
  constexpr double kDense_s = 1e-7, kSlope = 1e-5;
  EXPECT_NEAR(run.t_s, std::acos(0.5), kDense_s);
  EXPECT_NEAR(run.event_rate, std::sin(run.t_s), kSlope);
}

TEST(Radau, EndsWhereNoStepIsShortEnough) {
  auto stepper = radau_for(Explosion{}, 1e-8);
  stepper.start(0.0, {{1.0}});
  StepEnd end = StepEnd::accepted;
  while (end == StepEnd::accepted && stepper.t_s() < 2.0) end = stepper.step(2.0);
  EXPECT_TRUE(end == StepEnd::rounding_limit || end == StepEnd::not_finite);
  constexpr double kNearPole_s = 1e-3;  // y = 1 / (1 - t): a relative error moves the pole
  EXPECT_NEAR(stepper.t_s(), 1.0, kNearPole_s);
}

/// A slope that is no number from some time on.
template <class T>
struct Broken {
  using Scalar = T;
  static constexpr int kStates = 1;
  T rate;
  bool values_too;
  void derivative(double t, const State<T, 1>& y, State<T, 1>& dy) const {
    dy[0] = -rate * y[0];
    if (t < 0.5) return;
    if (values_too) dy[0] = T(NAN);
    if constexpr (requires { T::kLanes; }) set_lane(dy[0].derivative, 0, NAN);
  }
  Broken<double> values() const { return {value_of(rate), values_too}; }
};

TEST(Radau, EndsBeforeSlopesOrDerivativesThatAreNoNumbers) {
  constexpr double kTolerance = 1e-8, kAllowed = 100.0 * kTolerance;  // of the steps together
  auto stepper = radau_for(Broken<double>{1.0, true}, kTolerance);
  stepper.start(0.0, {{1.0}});
  StepEnd end = StepEnd::accepted;
  while (end == StepEnd::accepted && stepper.t_s() < 1.0) end = stepper.step(1.0);
  EXPECT_EQ(end, StepEnd::not_finite);
  EXPECT_NEAR(stepper.y()[0], std::exp(-stepper.t_s()), kAllowed);

  using D = Dual<4>;
  auto derived = radau_for(Broken<D>{D::variable(1.0, 0), false}, kTolerance);
  derived.start(0.0, {{D(1.0)}});
  end = StepEnd::accepted;
  while (end == StepEnd::accepted && derived.t_s() < 1.0) end = derived.step(1.0);
  EXPECT_EQ(end, StepEnd::not_finite);
  EXPECT_NEAR(derived.y()[0].derivative[0], -derived.t_s() * std::exp(-derived.t_s()), kAllowed);
}

TEST(Radau, EndsAtItsStepLimit) {
  StepControl<2> control = uniform_control<2>(1e-9);
  control.max_steps = 5;
  Radau<Relaxation<double>> stepper({1e5, 1.0}, control);
  stepper.start(0.0, {{1.0, 0.0}});
  StepEnd end = StepEnd::accepted;
  while (end == StepEnd::accepted) end = stepper.step(3.0);
  EXPECT_EQ(end, StepEnd::step_limit);
}

template <class S>
using Slide = Sliding<S, Coulomb, LinearAir, QuadraticAir, AirForce, GapLayer, RollingFriction,
                      PivotingFriction, ContourFriction>;

RimInput<double> input_of(const data::Scene& scene, const RimBody& body) {
  const RimStart s = rim_start(scene, body);
  return {s.theta_rad,
          s.phi_rad,
          s.psi_rad,
          s.w1_rad_s,
          s.w2_rad_s,
          s.w3_rad_s,
          s.x_m,
          s.y_m,
          s.vx_m_s,
          s.vy_m_s,
          loss_values(scene.model),
          *scene.model.friction,
          *scene.model.slip_regularisation_m_s};
}

/// Friction 20 times as sharp as the reference's: 1e5 1/s beside turns of 10 1/s.
data::Scene stiff_scene() {
  data::Scene scene = reference("s08_slide_disc").posed.scene;
  scene.model.slip_regularisation_m_s = 5e-5;
  return scene;
}

// SUNDIALS shares no line of the integration; its forward sensitivities are of the friction
// coefficient and of the speed over which friction sets in, those an explicit method loses first.
TEST(Radau, FollowsAStiffBodyAndItsDerivativesAsSundialsDoes) {
  const data::Scene scene = stiff_scene();
  const RimModel model{rim_body(scene), scene.model};
  const RimInput<double> input = input_of(scene, model.body);
  constexpr int n = 10;
  Slide<double> numbers;
  Slide<Dual<16>> duals;
  Slide<Dual<4>> by_friction;
  place(model, input, numbers);
  place(model, input, duals);
  place(model, input, by_friction);
  numbers.friction = {input.friction, input.eps_v};
  duals.friction = {Dual<16>(input.friction), Dual<16>(input.eps_v)};
  by_friction.friction = {Dual<4>::variable(input.friction, 0), Dual<4>::variable(input.eps_v, 1)};
  const State<double, n> start = rim_state(model.body, input);
  const std::array<double, 3> t_s{0.05, 0.3, 0.8};

  Ode ode = make_ode(duals);
  ode.sensitivities.start = Eigen::MatrixXd::Zero(n, 2);
  ode.sensitivities.derivative = [&](double t, const double* y, const double* s, double* ds) {
    State<Dual<4>, n> state, rate;
    for (int i = 0; i < n; ++i) {
      state[i] = Dual<4>(y[i]);
      for (int p = 0; p < 2; ++p) set_lane(state[i].derivative, p, s[i + p * n]);
    }
    by_friction.derivative(t, state, rate);
    for (int i = 0; i < n; ++i)
      for (int p = 0; p < 2; ++p) ds[i + p * n] = rate[i].derivative[p];
  };
  SundialsOptions options;
  options.rtol = 1e-12;
  options.atol = Eigen::VectorXd::Constant(n, 1e-14);
  const SundialsRun theirs =
      integrate_sundials(ode, 0.0, Eigen::Map<const Eigen::VectorXd>(start.v, n), t_s, options);
  ASSERT_EQ(theirs.outcome, Outcome::reached_end);

  RimRunOptions asked;
  asked.tolerance = 1e-9;
  // A hundred local errors; step control looks at values, not at derivatives.
  constexpr double kValue = 1e-7, kOfDerivative = 1e-4, kDerivative = 1e-5;
  using Stepper = Radau<Slide<Dual<4>>>;
  StepControl<n> control = Stepper::loosened(rim_control<n>(model.body, asked));
  resolve_stick(input.eps_v, control);
  Stepper stepper(by_friction, control);
  State<Dual<4>, n> from;
  for (int i = 0; i < n; ++i) from[i] = Dual<4>(start[i]);
  stepper.start(0.0, from);
  for (int row = 0; row < 3; ++row) {
    while (stepper.t_s() < t_s[row]) ASSERT_EQ(stepper.step(t_s[row]), StepEnd::accepted);
    for (const int c : {Rim::phi, Rim::theta, Rim::x, Rim::y}) {
      const Dual<4> ours = stepper.y()[c];
      EXPECT_NEAR(ours.value, theirs.states(row, c), kValue) << t_s[row] << " s, " << c;
      for (int p = 0; p < 2; ++p) {
        const double derivative = theirs.sensitivities(row, c + p * n);
        EXPECT_NEAR(ours.derivative[p], derivative,
                    kOfDerivative * std::abs(derivative) + kDerivative)
            << t_s[row] << " s, " << c << " by " << p;
      }
    }
  }
  EXPECT_LT(stepper.counts().steps, 2000);
}

// Explicit steps at the edge of stability keep the values, but the derivatives run away.
TEST(Radau, DerivativesOfSoftFrictionAreRightAtAnyTolerance) {
  const data::Scene scene = stiff_scene();
  const auto predictor = make_predictor(scene);
  const auto& infos = predictor->parameters();
  Eigen::VectorXd values(static_cast<Eigen::Index>(infos.size()));
  PredictRequest request;
  for (int i = 0; i < values.size(); ++i) {
    values[i] = infos[static_cast<std::size_t>(i)].value;
    request.derivatives.push_back(i);
  }
  const std::array<double, 4> t_s{0.1, 0.4, 0.7, 0.9};
  request.t_s = t_s;
  request.tolerance = 1e-11;
  const Prediction exact = predictor->predict(values, request);
  ASSERT_EQ(exact.outcome, Outcome::reached_end);
  for (const double tolerance : {1e-4, 1e-6, 1e-8}) {
    request.tolerance = tolerance;
    const Prediction rough = predictor->predict(values, request);
    for (int i = 0; i < values.size(); ++i)
      EXPECT_LE((rough.jacobian.col(i) - exact.jacobian.col(i)).norm(),
                2e-2 * exact.jacobian.col(i).norm())
          << infos[static_cast<std::size_t>(i)].name << " at " << tolerance;
  }
}

// A body that sticks creeps: the slip it has then is a share of the speed over which friction sets
// in, however slow that is, beside velocities of the body of 1 m/s. The path goes to that of the
// exact law in proportion to that speed.
TEST(Radau, ABodySticksHoweverSharplyFrictionSetsIn) {
  data::Scene scene = reference("s08_slide_disc").posed.scene;
  const std::array<double, 1> t_s{0.8};
  const auto predicted = [&](double eps_v_m_s, double tolerance) {
    scene.model.slip_regularisation_m_s = eps_v_m_s;
    const auto predictor = make_predictor(scene);
    const auto& infos = predictor->parameters();
    Eigen::VectorXd values(static_cast<Eigen::Index>(infos.size()));
    for (int i = 0; i < values.size(); ++i) values[i] = infos[static_cast<std::size_t>(i)].value;
    PredictRequest request;
    request.t_s = t_s;
    request.tolerance = tolerance;
    return predictor->predict(values, request);
  };
  const Prediction sharp = predicted(1e-12, 1e-12);
  ASSERT_EQ(sharp.outcome, Outcome::reached_end);
  for (const double eps_v_m_s : {1e-4, 1e-6, 1e-8, 1e-9, 1e-10, 1e-12})
    for (const double tolerance : {1e-1, 1e-3, 1e-6, 1e-10, 1e-13}) {
      const Prediction run = predicted(eps_v_m_s, tolerance);
      ASSERT_EQ(run.outcome, Outcome::reached_end) << eps_v_m_s << " at " << tolerance;
      EXPECT_LT(run.steps, 10000) << eps_v_m_s << " at " << tolerance;
      EXPECT_LT((run.values - sharp.values).norm(), 30.0 * eps_v_m_s + 0.1 * tolerance + 1e-9)
          << eps_v_m_s << " at " << tolerance;
    }
}

}  // namespace
}  // namespace trochoid::model
