#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "common.hpp"
#include "derivative_columns.hpp"
#include "reference_cases.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::model {
namespace {

const std::vector<Observable> kAll{Observable::x_m, Observable::y_m, Observable::theta_rad,
                                   Observable::phi_rad, Observable::psi_rad};

struct ReferenceError {
  double xy_m = 0.0, theta_rad = 0.0, phi_rad = 0.0, psi_rad = 0.0;
};

ReferenceError compare_with(const std::string& name, double tolerance) {
  const Reference expected = reference(name);
  const auto predictor = make_predictor(expected.posed.scene);
  const Eigen::VectorXd t_s = expected.column("t");
  PredictRequest request;
  request.t_s = {t_s.data(), static_cast<std::size_t>(t_s.size())};
  request.observables = kAll;
  request.tolerance = tolerance;
  const Prediction run = predictor->predict(defaults(*predictor), request);
  EXPECT_EQ(run.outcome, Outcome::reached_end);
  ReferenceError error;
  const auto largest = [&](int slot, const char* column) {
    const Eigen::VectorXd truth = expected.column(column);
    double worst = 0.0;
    for (Eigen::Index n = 0; n < truth.size(); ++n)
      worst = std::max(worst, std::abs(run.values[5 * n + slot] - truth[n]));
    return worst;
  };
  error.xy_m = std::max(largest(0, "x"), largest(1, "y"));
  error.theta_rad = largest(2, "theta");
  error.phi_rad = largest(3, "phi");
  error.psi_rad = largest(4, "psi");
  return error;
}

// The references state their own uncertainty: a few 1e-11 rad in the angles, 1e-12 of l in the
// path; with a margin for ours.
constexpr double kTopAngle_rad = 2e-10, kTopPath_m = 2e-11;

TEST(Top, FollowsTheReferenceOfTheThesisBaseCase) {
  const ReferenceError error = compare_with("s03_top_thesis_base", 1e-13);
  EXPECT_LT(error.xy_m, kTopPath_m);
  EXPECT_LT(error.theta_rad, kTopAngle_rad);
  EXPECT_LT(error.phi_rad, kTopAngle_rad);
  EXPECT_LT(error.psi_rad, kTopAngle_rad);
}
TEST(Top, FollowsTheReferenceWithLoops) {
  const ReferenceError error = compare_with("s04_top_loops", 1e-13);
  EXPECT_LT(error.xy_m, kTopPath_m);
  EXPECT_LT(error.theta_rad, kTopAngle_rad);
  EXPECT_LT(error.phi_rad, kTopAngle_rad);
  EXPECT_LT(error.psi_rad, kTopAngle_rad);
}
TEST(Top, FollowsTheReferenceWithDrag) {
  const ReferenceError error = compare_with("s11_top_drag", 1e-13);
  EXPECT_LT(error.xy_m, kTopPath_m);
  EXPECT_LT(error.theta_rad, kTopAngle_rad);
  EXPECT_LT(error.phi_rad, kTopAngle_rad);
  EXPECT_LT(error.psi_rad, 10.0 * kTopAngle_rad);  // psi turns through 800 rad
}

// Quadruple-precision values at t = 60 s of the base case (order-40 Taylor series in two forms,
// which agree to 8e-16), in our axes (x, y) = (Y, -X) of the thesis.
TEST(Top, AgreesWithQuadruplePrecisionAtTheEndOfTheBaseCase) {
  const auto predictor = make_predictor(reference("s03_top_thesis_base").posed.scene);
  const std::vector<double> t_s{60.0};
  PredictRequest request;
  request.t_s = t_s;
  request.observables = kAll;
  request.tolerance = 1e-14;
  request.want_end_state = true;
  const Prediction run = predictor->predict(defaults(*predictor), request);
  constexpr double kAllowed = 2e-12;  // rounding of some hundred steps
  EXPECT_NEAR(run.values[0] / 0.1, 0.9586900216767394, kAllowed);
  EXPECT_NEAR(run.values[1] / 0.1, 0.2342951380256336, kAllowed);
  EXPECT_NEAR(run.values[2], 1.408783727431625, kAllowed);
  EXPECT_NEAR(run.values[3], 8.093674237305249, kAllowed);
  EXPECT_NEAR(run.values[4], 27.96522705748539, 10 * kAllowed);
  EXPECT_NEAR(run.end_state[3], -.01155817902693137, kAllowed);
  EXPECT_NEAR(run.end_state[4], .260807426882936, kAllowed);
}

/// Random scenes of the kind a camera sees.
Eigen::VectorXd random_values(const Predictor& predictor, std::mt19937_64& random) {
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  Eigen::VectorXd values = defaults(predictor);
  const auto set = [&](const char* name, double value) {
    if (const int i = predictor.index_of(name); i >= 0) values[i] = value;
  };
  const double b = 0.5 * std::exp(unit(random) * std::log(20.0));
  set("b_1_s", b);
  set("a_1_s2", b * b * (0.015 + 0.7 * unit(random)));
  set("l_m", 0.02 + 0.1 * unit(random));
  set("theta_rad", 0.25 + unit(random));
  set("phi_rad", 6.0 * unit(random));
  set("dtheta_rad_s", b * 0.2 * (unit(random) - 0.5));
  set("dphi_rad_s", b * 0.2 * (unit(random) - 0.5));
  set("gamma1_1_s", 0.02 * b * unit(random));
  set("gamma3_1_s", 0.02 * b * unit(random));
  set("omega_s_rad_s", 3.0 * b);
  return values;
}

data::Scene plain_top(bool drag) {
  data::Scene scene;
  scene.model.name = "top";
  if (drag) scene.model.drag_transverse_N_m_s = scene.model.drag_spin_N_m_s = 1e-6;
  return scene;
}

// Derivatives against central differences of order 4, whose error with step h is h^4 f5/30 plus
// rounding 1e-13/h of a run at 1e-14: about 1e-9 of the largest derivative.
void check_derivatives(bool drag, unsigned seed) {
  std::mt19937_64 random(seed);
  const auto predictor = make_predictor(plain_top(drag));
  const Eigen::VectorXd at = random_values(*predictor, random);
  std::vector<double> t_s;
  const double end_s = 15.0 / at[1];
  for (int n = 0; n <= 40; ++n) t_s.push_back(end_s * n / 40.0);
  PredictRequest request;
  request.t_s = t_s;
  request.observables = kAll;
  for (const DerivativeColumn& column : derivative_columns(*predictor, at, request, 2e-3))
    EXPECT_LT(column.error(), 2e-7 * (1.0 + column.size()))
        << column.parameter << ", seed " << seed;
}
TEST(Top, DerivativesMatchDifferencesAtRandomPoints) {
  for (unsigned seed = 1; seed <= 10; ++seed) check_derivatives(false, seed);
}
TEST(Top, DerivativesMatchDifferencesWithDrag) {
  for (unsigned seed = 1; seed <= 10; ++seed) check_derivatives(true, seed);
}

// Shooting: the state at a break, handed in as the next start, continues the same motion.
TEST(Top, EndStateContinuesTheMotion) {
  std::mt19937_64 random(7);
  const auto predictor = make_predictor(plain_top(true));
  const Eigen::VectorXd at = random_values(*predictor, random);
  const double break_s = 4.0 / at[1], end_s = 9.0 / at[1];
  const std::vector<double> whole{break_s, end_s}, first{break_s}, second{end_s};
  PredictRequest request;
  request.observables = kAll;
  request.tolerance = 1e-13;
  request.t_s = whole;
  const Prediction direct = predictor->predict(at, request);
  request.t_s = first;
  request.want_end_state = true;
  const Prediction leg = predictor->predict(at, request);
  Eigen::VectorXd onwards = at;
  int next = 0;
  for (std::size_t i = 0; i < predictor->parameters().size(); ++i) {
    if (predictor->parameters()[i].role == ParameterInfo::Role::initial)
      onwards[static_cast<Eigen::Index>(i)] = leg.end_state[next++];
  }
  ASSERT_EQ(next, leg.end_state.size());
  request.t_s = second;
  request.start_s = break_s;
  const Prediction rest = predictor->predict(onwards, request);
  constexpr double kJoined = 1e-10;  // a thousand local errors of 1e-13
  for (int slot = 0; slot < 5; ++slot)
    EXPECT_NEAR(rest.values[slot], direct.values[5 + slot], kJoined) << slot;
}

// (theta, a, b) -> (pi - theta, -a, -b) is excluded by a > 0; (theta, phi) -> (-theta, phi + pi) by
// theta > 0. Turning phi turns the path.
TEST(Top, TurningPhiTurnsThePath) {
  std::mt19937_64 random(3);
  const auto predictor = make_predictor(plain_top(false));
  Eigen::VectorXd at = random_values(*predictor, random);
  const std::vector<double> t_s{0.3, 1.0, 2.0};
  PredictRequest request;
  request.t_s = t_s;
  request.tolerance = 1e-12;
  const Prediction before = predictor->predict(at, request);
  const double turn = 0.7;
  constexpr double kSameSteps_m = 1e-11;  // but for rounding, which may change one; tolerance 1e-12
  at[predictor->index_of("phi_rad")] += turn;
  const Prediction after = predictor->predict(at, request);
  for (int n = 0; n < 3; ++n) {
    const double x = before.values[2 * n], y = before.values[2 * n + 1];
    EXPECT_NEAR(after.values[2 * n], std::cos(turn) * x - std::sin(turn) * y, kSameSteps_m);
    EXPECT_NEAR(after.values[2 * n + 1], std::sin(turn) * x + std::cos(turn) * y, kSameSteps_m);
  }
}

TEST(Top, RefusesWhatItCannotPredict) {
  const auto predictor = make_predictor(plain_top(false));
  Eigen::VectorXd at = defaults(*predictor);
  const std::vector<double> backwards{1.0, 0.5}, t_s{1.0};
  PredictRequest request;
  request.t_s = backwards;
  EXPECT_THROW((void)predictor->predict(at, request), InputError);
  request.t_s = t_s;
  at[predictor->index_of("theta_rad")] = 4.0;
  EXPECT_THROW((void)predictor->predict(at, request), InputError);
  at[predictor->index_of("theta_rad")] = NAN;
  EXPECT_THROW((void)predictor->predict(at, request), InputError);
}

}  // namespace
}  // namespace trochoid::model
