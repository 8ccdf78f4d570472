#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "common.hpp"
#include "derivative_columns.hpp"
#include "top_scene.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/model/predictor.hpp"
#include "trochoid/model/simulate.hpp"

// Drag on a top's spin that is dry or quadratic.
namespace trochoid::model {
namespace {

/// A top of tests/independent/make_tops.py, in SI units as its truth.json states it.
struct OtherTop {
  const char* name;
  double I_kg_m2, Is_kg_m2, mass_kg, l_m, across_N_m_s, dry_N_m, quadratic_N_m_s2;
  double theta_rad, phi_rad, dtheta_rad_s, dphi_rad_s, spin_rad_s;
};
constexpr OtherTop kDry{
    "top_dry_spin",       0.0002527656844628842,  0.00019752011329087608, 0.19076289544727876,
    0.028413278155765498, 6.2250784275738975e-06, 0.00159562886947826,    0.0,
    0.9586201590355996,   -1.2743178076285306,    0.7259550603102136,     2.7476306630415954,
    44.835169519040214};
constexpr OtherTop kQuadratic{"top_quadratic_spin",
                              0.00011254217066047629,
                              7.716147384807132e-05,
                              0.07018053198596166,
                              0.03246342464575608,
                              5.28997186856265e-06,
                              0.0,
                              6.177554151013778e-07,
                              0.9597836420336636,
                              -0.41458262448925165,
                              -0.7053841680620132,
                              3.625755573831162,
                              40.057504174192346};

data::Table path_of(const OtherTop& top) {
  return data::read_table(std::string(TROCHOID_SOURCE_DIR) + "/tests/independent/cases/" +
                          top.name + "/path.csv");
}

data::Scene scene_of(const OtherTop& top) {
  data::Scene scene;
  scene.model.name = "top";
  data::Body& body = scene.body.emplace();
  body.kind = data::BodyKind::top;
  body.I_kg_m2 = top.I_kg_m2;
  body.Is_kg_m2 = top.Is_kg_m2;
  body.mass_kg = top.mass_kg;
  body.l_m = top.l_m;
  scene.model.drag_transverse_N_m_s = top.across_N_m_s;
  if (top.dry_N_m > 0.0) scene.model.drag_spin_dry_N_m = top.dry_N_m;
  if (top.quadratic_N_m_s2 > 0.0) scene.model.drag_spin_quadratic_N_m_s2 = top.quadratic_N_m_s2;
  scene.start.theta_rad = top.theta_rad;
  scene.start.phi_rad = top.phi_rad;
  scene.start.dtheta_rad_s = top.dtheta_rad_s;
  scene.start.dphi_rad_s = top.dphi_rad_s;
  scene.start.omega_s_rad_s = top.spin_rad_s;
  return scene;
}

// scipy's DOP853 at 1e-12, in body axes with a quaternion; dry friction stops the one spin halfway.
TEST(TopSpinDrag, FollowsThePathsOfAnotherProgram) {
  constexpr double kOthers_m = 1e-10;  // its steps' errors together
  for (const OtherTop& top : {kDry, kQuadratic}) {
    const data::Table path = path_of(top);
    const Eigen::VectorXd t_s = path.column("t_s"), x = path.column("x_m"), y = path.column("y_m");
    const auto predictor = make_predictor(scene_of(top));
    PredictRequest request;
    request.t_s = {t_s.data(), static_cast<std::size_t>(t_s.size())};
    request.tolerance = 1e-13;
    const Prediction run = predictor->predict(defaults(*predictor), request);
    for (Eigen::Index n = 0; n < t_s.size(); ++n) {
      EXPECT_NEAR(run.values[2 * n], x[n], kOthers_m) << top.name << " at " << t_s[n];
      EXPECT_NEAR(run.values[2 * n + 1], y[n], kOthers_m) << top.name << " at " << t_s[n];
    }
  }
}

// The spin is dpsi + dphi cos(theta); psi is the integral of dpsi, here by Simpson's rule.
TEST(TopSpinDrag, TurnsAsFastAsInAnotherProgramAndByTheIntegralOfThat) {
  constexpr double kSpin_rad_s = 1e-7;  // tolerance 1e-10, of a thousand steps
  constexpr double kSimpson = 1e-4;     // its rule, with four steps from row to row
  for (const OtherTop& top : {kDry, kQuadratic}) {
    const data::Table path = path_of(top);
    const Eigen::VectorXd t_s = path.column("t_s"), spin = path.column("spin_rad_s");
    for (const char* integrator : {"taylor", "dop853"}) {
      data::Scene scene = scene_of(top);
      scene.run.until_s = t_s[t_s.size() - 1];
      scene.run.rate_hz = 4.0 * static_cast<double>(t_s.size() - 1) / scene.run.until_s;
      scene.run.integrator = integrator;
      const Trajectory run = simulate(scene);
      ASSERT_EQ(run.outcome, Outcome::reached_end);
      double turned_rad = 0.0;
      const auto rate = [&](Eigen::Index row) { return run.values(row, 6); };
      for (Eigen::Index n = 0; n + 1 < t_s.size(); ++n) {
        const Eigen::Index row = 4 * n;
        const double here = run.values(row, 6) + run.values(row, 4) * std::cos(run.values(row, 2));
        EXPECT_NEAR(here, spin[n], kSpin_rad_s) << top.name << " at " << t_s[n];
        const double step_s = t_s[n + 1] - t_s[n];
        turned_rad += step_s / 12.0 *
                      (rate(row) + 4.0 * rate(row + 1) + 2.0 * rate(row + 2) + 4.0 * rate(row + 3) +
                       rate(row + 4));
        EXPECT_NEAR(run.values(row + 4, 3), turned_rad, kSimpson * (1.0 + turned_rad)) << top.name;
      }
    }
  }
}

// Derivatives against central differences; the spin of the first two stops on the way,
// and moves on with every parameter: a jump of one of its derivatives costs the differences some
// digits.
TEST(TopSpinDrag, DerivativesMatchDifferences) {
  struct Drags {
    double dry_N_m, linear_N_m_s, quadratic_N_m_s2;
  };
  const double t0 = kDry.dry_N_m, q = kQuadratic.quadratic_N_m_s2;
  for (const Drags& drags : {Drags{t0, 0.0, 0.0}, {t0, 1e-6, 0.1 * q}, {0.0, 0.0, q}}) {
    data::Scene scene = scene_of(kDry);
    scene.model.drag_spin_dry_N_m.reset();
    if (drags.dry_N_m > 0.0) scene.model.drag_spin_dry_N_m = drags.dry_N_m;
    if (drags.linear_N_m_s > 0.0) scene.model.drag_spin_N_m_s = drags.linear_N_m_s;
    if (drags.quadratic_N_m_s2 > 0.0)
      scene.model.drag_spin_quadratic_N_m_s2 = drags.quadratic_N_m_s2;
    const auto predictor = make_predictor(scene);
    const Eigen::VectorXd at = defaults(*predictor);
    std::vector<double> t_s;
    for (int n = 0; n <= 20; ++n) t_s.push_back(0.2 * n);
    PredictRequest request;
    request.t_s = t_s;
    request.observables = {Observable::x_m, Observable::y_m, Observable::theta_rad,
                           Observable::phi_rad, Observable::psi_rad};
    constexpr double kDifferences = 2e-5;  // of steps of 1e-5
    for (const DerivativeColumn& column : derivative_columns(*predictor, at, request, 1e-5))
      EXPECT_LT(column.error(), kDifferences * (1.0 + column.size())) << column.parameter;
  }
}

// Against Simpson's rule for dt = db / (dry + gamma3 b + quadratic b^2), where the discriminant is
// positive, negative and zero.
TEST(TopSpinDrag, ASpinLastsAsLongAsItsLossesAllow) {
  struct Drags {
    double dry, gamma3, quadratic;
  };
  constexpr double kSpin = 20.0;
  for (const Drags& d :
       {Drags{0.5, 0.3, 0.001}, {2.0, 0.01, 0.02}, {1.0, 0.2, 0.01}, {3.0, 0, 0}}) {
    constexpr int kSteps = 20000;
    double sum = 0.0;
    for (int i = 0; i <= kSteps; ++i) {
      const double b = kSpin * i / kSteps;
      const double weight = i == 0 || i == kSteps ? 1.0 : i % 2 == 1 ? 4.0 : 2.0;
      sum += weight / (d.dry + (d.gamma3 + d.quadratic * b) * b);
    }
    const double lasts_s = sum * kSpin / (3.0 * kSteps);
    // h^4 of its steps and rounding of their sum, 1e-12, with a margin.
    constexpr double kRule = 1e-9;
    EXPECT_NEAR(spin_lasts_s(-kSpin, d.dry, d.gamma3, d.quadratic), lasts_s, kRule * lasts_s);
  }
  EXPECT_EQ(spin_lasts_s(kSpin, 0.0, 0.1, 0.1), INFINITY);
  EXPECT_EQ(spin_lasts_s(0.0, 1.0, 0.1, 0.1), 0.0);
  // So little dry drag that tanh(root t) rounds to more than 1.
  EXPECT_GT(spin_lasts_s(kSpin, 1e-30, 0.47, 0.0), 100.0);
}

// A spin so small that it is gone within rounding of the first sample's time is no spin: dry drag
// that went on would turn the top the other way round.
TEST(TopSpinDrag, HoldsASpinThatIsUsedUpAtOnce) {
  const auto predictor = make_predictor(scene_of(kDry));
  Eigen::VectorXd values = defaults(*predictor);
  const std::vector<double> t_s{5.0, 6.0, 7.0};
  PredictRequest request;
  request.t_s = t_s;
  request.start_s = t_s.front();
  request.tolerance = 1e-12;
  const int spin = predictor->index_of("b_1_s");
  values[spin] = 0.0;
  const Eigen::VectorXd none = predictor->predict(values, request).values;
  for (const double b_1_s : {1e-17, -1e-17}) {
    values[spin] = b_1_s;
    const Eigen::VectorXd little = predictor->predict(values, request).values;
    constexpr double kSamePath_m = 1e-10;  // tolerance 1e-12, of a hundred steps
    EXPECT_LT((little - none).cwiseAbs().maxCoeff(), kSamePath_m) << b_1_s;
  }
}

// Dry drag takes away a little spin within a time that goes as the spin, so that what it does goes
// as the square.
TEST(TopSpinDrag, HasNoDerivativeByASpinThatDryDragHolds) {
  const auto predictor = make_predictor(scene_of(kDry));
  Eigen::VectorXd at = defaults(*predictor);
  at[predictor->index_of("b_1_s")] = at[predictor->index_of("omega_s_rad_s")] = 0.0;
  const std::vector<double> t_s{0.0, 0.4, 1.0};
  PredictRequest request;
  request.t_s = t_s;
  request.observables = {Observable::x_m, Observable::y_m, Observable::theta_rad,
                         Observable::phi_rad, Observable::psi_rad};
  constexpr double kDifferences = 1e-3;  // of a kink's curvature over steps of 1e-7
  for (const DerivativeColumn& column : derivative_columns(*predictor, at, request, 1e-5))
    if (column.parameter == "b_1_s") {
      EXPECT_LT(column.error(), kDifferences);
    }
}

TEST(TopSpinDrag, IsRefusedWhereTheIntegratorDoesNotKnowIt) {
  data::Scene scene = scene_of(kDry);
  scene.run.until_s = 1.0;
  scene.run.integrator = "cvode-adams";
  EXPECT_THROW((void)simulate(scene), InputError);
}

// A scene without such a drag has no parameter for it.
TEST(TopSpinDrag, IsAParameterOnlyWhereItIsNamed) {
  const auto dry = make_predictor(scene_of(kDry));
  EXPECT_GE(dry->index_of("gamma3_dry_1_s2"), 0);
  EXPECT_LT(dry->index_of("gamma3_1_s"), 0);
  EXPECT_LT(dry->index_of("gamma3_quadratic"), 0);
}

}  // namespace
}  // namespace trochoid::model
