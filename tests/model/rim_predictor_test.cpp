#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "common.hpp"
#include "reference_cases.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/reference_case.hpp"
#include "trochoid/model/predictor.hpp"
#include "trochoid/model/simulate.hpp"

namespace trochoid::model {
namespace {

constexpr Observable kEverything[] = {Observable::x_m, Observable::y_m, Observable::theta_rad,
                                      Observable::phi_rad, Observable::psi_rad};

struct Errors {
  double theta_rad = 0.0, phi_rad = 0.0, xy_m = 0.0;
  Outcome outcome = Outcome::reached_end;
};

Errors errors_against_reference(const std::string& name, double tolerance) {
  const data::Table table = data::read_table(reference_path(name, ".csv"));
  const auto predictor = make_predictor(reference_scene(name));
  const Eigen::VectorXd t_s = table.column("t");
  PredictRequest request;
  request.t_s = {t_s.data(), static_cast<std::size_t>(t_s.size())};
  request.observables.assign(std::begin(kEverything), std::end(kEverything));
  request.tolerance = tolerance;
  const Prediction run = predictor->predict(defaults(*predictor), request);
  Errors errors;
  for (Eigen::Index n = 0; n < t_s.size(); ++n) {
    const auto at = [&](int o) { return run.values[5 * n + o]; };
    errors.xy_m = std::max(errors.xy_m,
                           std::hypot(at(0) - table.column("x")[n], at(1) - table.column("y")[n]));
    errors.theta_rad = std::max(errors.theta_rad, std::abs(at(2) - table.column("theta")[n]));
    errors.phi_rad = std::max(errors.phi_rad, std::abs(at(3) - table.column("phi")[n]));
  }
  errors.outcome = run.outcome;
  return errors;
}

struct Bound {
  const char* name;
  double theta_rad, xy_m;  ///< what an ordinary integration reaches, from the folder's README
};
class AgainstReference : public testing::TestWithParam<Bound> {};

TEST_P(AgainstReference, MeetsTheToleranceOfTheCase) {
  const Errors errors = errors_against_reference(GetParam().name, 1e-13);
  EXPECT_EQ(errors.outcome, Outcome::reached_end);
  EXPECT_LE(errors.theta_rad, GetParam().theta_rad);
  EXPECT_LE(errors.xy_m, GetParam().xy_m);
}

INSTANTIATE_TEST_SUITE_P(Rim, AgainstReference,
                         testing::Values(Bound{"s05_smooth_disc", 2e-7, 1e-12},
                                         Bound{"s06_roll_disc", 4e-9, 5e-10},
                                         Bound{"s07_roll_hoop_thin", 6e-9, 8e-10},
                                         Bound{"s08_slide_disc", 4e-7, 4e-8},
                                         Bound{"s09_ring_retrograde_drag", 3e-8, 4e-9},
                                         Bound{"s10_stick_slip_event", 4e-5, 3e-6}));

/// Scenes with every term, near the reference cases, at a random start.
data::Scene random_scene(std::mt19937& draw, const std::string& name) {
  std::uniform_real_distribution<double> u(0.0, 1.0);
  data::Scene scene = reference_scene(name);
  scene.model.air_linear_N_m_s = Eigen::Vector3d(1e-6, 1e-6, 3e-6) * (0.5 + u(draw));
  scene.model.air_quadratic_N_m_s2 = Eigen::Vector3d(2e-8, 2e-8, 1e-8) * (0.5 + u(draw));
  scene.model.air_force_N_s_m = 1e-3 * u(draw);
  scene.model.gap_viscosity_Pa_s = 1.8e-5;
  scene.model.rolling_friction_m = 5e-5 * (0.5 + u(draw));
  scene.model.pivoting_friction_m = 2e-4 * (0.5 + u(draw));
  scene.model.contour_friction_m = 1e-4 * (0.5 + u(draw));
  scene.start.phi_rad = 6.0 * u(draw);
  *scene.start.theta_rad += 0.1 * (u(draw) - 0.5);
  *scene.start.w2_rad_s *= 1.0 + 0.1 * (u(draw) - 0.5);
  scene.start.x_m = 0.1;
  scene.start.y_m = -0.2;
  return scene;
}

/// Central differences of order four, step chosen so that truncation and rounding balance.
void expect_derivatives_match(const Predictor& predictor, const Eigen::VectorXd& values,
                              std::span<const double> t_s, double tolerance,
                              double relative_step = 2e-4, Outcome end = Outcome::reached_end) {
  PredictRequest request;
  request.t_s = t_s;
  request.observables.assign(std::begin(kEverything), std::end(kEverything));
  request.tolerance = 1e-13;
  request.want_end_state = true;
  request.lies_where_it_fell = true;
  for (int i = 0; i < values.size(); ++i) request.derivatives.push_back(i);
  const Prediction exact = predictor.predict(values, request);
  ASSERT_EQ(exact.outcome, end);
  request.derivatives.clear();
  for (int i = 0; i < values.size(); ++i) {
    const double h = relative_step * std::max(1e-3 * (values[i] == 0.0), std::abs(values[i]));
    const auto at = [&](double offset) {
      Eigen::VectorXd moved = values;
      moved[i] += offset;
      const Prediction run = predictor.predict(moved, request);
      Eigen::VectorXd all(run.values.size() + run.end_state.size());
      all << run.values, run.end_state;
      return all;
    };
    const Eigen::VectorXd difference =
        (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
    Eigen::VectorXd ours(difference.size());
    ours << exact.jacobian.col(i), exact.end_state_jacobian.col(i);
    const double scale = std::max(1e-3, difference.cwiseAbs().maxCoeff());
    EXPECT_LE((ours - difference).cwiseAbs().maxCoeff(), tolerance * scale)
        << predictor.model_name() << " by " << predictor.parameters()[i].name;
  }
}

TEST(RimPredictor, DifferentiatesRollingByEveryParameter) {
  std::mt19937 draw(3);
  const std::vector<double> t_s{0.05, 0.3, 0.7, 1.0};
  for (int i = 0; i < 3; ++i) {
    const auto predictor = make_predictor(random_scene(draw, "s06_roll_disc"));
    expect_derivatives_match(*predictor, defaults(*predictor), t_s, 1e-6);
  }
}

TEST(RimPredictor, DifferentiatesSmoothMotionByEveryParameter) {
  std::mt19937 draw(4);
  data::Scene scene = reference_scene("s05_smooth_disc");
  scene.start.phi_rad = 0.4;
  const auto predictor = make_predictor(scene);
  expect_derivatives_match(*predictor, defaults(*predictor), std::vector{0.1, 0.5}, 1e-6);
}

TEST(RimPredictor, DifferentiatesRegularisedSlidingByEveryParameter) {
  std::mt19937 draw(5);
  const auto predictor = make_predictor(random_scene(draw, "s08_slide_disc"));
  expect_derivatives_match(*predictor, defaults(*predictor), std::vector{0.02, 0.3}, 1e-5);
}

TEST(RimPredictor, DifferentiatesStiffFrictionByEveryParameter) {
  std::mt19937 draw(7);
  data::Scene scene = random_scene(draw, "s08_slide_disc");
  scene.model.slip_regularisation_m_s = 1e-6;  // too many explicit steps
  const auto predictor = make_predictor(scene);
  // Two runs of an implicit method differ by more than rounding: wider steps, laxer agreement.
  expect_derivatives_match(*predictor, defaults(*predictor), std::vector{0.02, 0.2}, 1e-3, 3e-3);
}

TEST(RimPredictor, DifferentiatesAcrossStickAndSlip) {
  std::mt19937 draw(6);
  const auto predictor = make_predictor(random_scene(draw, "s10_stick_slip_event"));
  expect_derivatives_match(*predictor, defaults(*predictor), std::vector{0.02, 0.2, 0.5, 0.8},
                           1e-4);
}

TEST(RimPredictor, DifferentiatesOnASlopeByEveryParameter) {
  std::mt19937 draw(8);
  for (const auto& [name, tolerance] :
       {std::pair{"s06_roll_disc", 1e-6}, {"s05_smooth_disc", 1e-5}, {"s08_slide_disc", 1e-5}}) {
    data::Scene scene = random_scene(draw, name);
    scene.support.slope_x = 0.01;
    scene.support.slope_y = -0.02;
    const auto predictor = make_predictor(scene);
    ASSERT_GE(predictor->index_of("slope_y"), 0);
    expect_derivatives_match(*predictor, defaults(*predictor), std::vector{0.05, 0.3}, tolerance);
  }
}

/// A disc on a soft floor falls flat within 0.6 s.
data::Scene soon_flat(const std::string& name) {
  data::Scene scene = reference_scene(name);
  scene.start.theta_rad = 0.3;
  scene.start.phi_rad = 1.0;
  scene.start.w2_rad_s = 18.0;
  scene.start.w3_rad_s = 0.5;
  scene.model.rolling_friction_m = 1.5e-3;
  scene.model.pivoting_friction_m = 2e-4;
  return scene;
}

// The instant of the fall depends on the parameters, and with it all that comes after.
TEST(RimPredictor, DifferentiatesWhereABodyFellFlat) {
  const auto check = [](const data::Scene& scene, double tolerance) {
    constexpr double kStep =
        4e-5;  // the quotient's error: rounding for less, for more phi, which runs fast at the end
    const auto predictor = make_predictor(scene);
    expect_derivatives_match(*predictor, defaults(*predictor), std::vector{0.05, 0.1, 2.0, 2.5},
                             tolerance, kStep, Outcome::flat);
  };
  check(soon_flat("s06_roll_disc"), 1e-5);
  data::Scene sliding = soon_flat("s08_slide_disc");
  check(sliding, 1e-4);
  sliding.model.slip_regularisation_m_s.reset();
  check(sliding, 1e-4);
}

// Up to the fall the explicit method would do, for much longer only a stiff solver: where it lies
// must not depend on which it was.
TEST(RimPredictor, AStiffSolverDifferentiatesWhereABodyFellFlatAlike) {
  data::Scene scene = soon_flat("s08_slide_disc");
  scene.model.slip_regularisation_m_s = 1e-5;
  const auto predictor = make_predictor(scene);
  PredictRequest request;
  request.observables.assign(std::begin(kEverything), std::end(kEverything));
  request.lies_where_it_fell = true;
  for (int i = 0; i < static_cast<int>(predictor->parameters().size()); ++i)
    request.derivatives.push_back(i);
  const auto lying_at = [&](double t_s) {
    request.t_s = {&t_s, 1};
    return predictor->predict(defaults(*predictor), request);
  };
  const Prediction soon = lying_at(1.1), late = lying_at(10.0);
  ASSERT_EQ(soon.outcome, Outcome::flat);
  ASSERT_EQ(late.outcome, Outcome::flat);
  EXPECT_NE(soon.steps, late.steps) << "one method for both";
  constexpr double kTolerance = 1e-6;  // its derivatives are integrated to 1e-9
  EXPECT_LE((soon.values - late.values).norm(), kTolerance);
  for (int i = 0; i < soon.jacobian.cols(); ++i)
    EXPECT_LE((soon.jacobian.col(i) - late.jacobian.col(i)).norm(),
              kTolerance * soon.jacobian.col(i).norm())
        << predictor->parameters()[static_cast<std::size_t>(i)].name;
}

TEST(RimPredictor, ABodyThatFellFlatLiesWhereItFell) {
  const auto predictor = make_predictor(soon_flat("s06_roll_disc"));
  const Eigen::VectorXd values = defaults(*predictor);
  PredictRequest request;
  std::vector<double> t_s{0.0, 2.0};
  request.t_s = t_s;
  request.observables.assign(std::begin(kEverything), std::end(kEverything));
  const Prediction ended = predictor->predict(values, request);
  ASSERT_EQ(ended.outcome, Outcome::flat);
  EXPECT_TRUE(std::isnan(ended.values[5]));
  request.lies_where_it_fell = true;
  constexpr double kJustBefore = 1.0 - 1e-9;
  t_s = {0.0, kJustBefore * ended.valid_until_s, 2.0, 2.5};
  request.t_s = t_s;
  const Prediction run = predictor->predict(values, request);
  EXPECT_EQ(run.outcome, Outcome::flat);
  EXPECT_EQ(run.valid_until_s, ended.valid_until_s);
  const auto falling = run.values.segment<5>(5), lying = run.values.segment<5>(10);
  constexpr double kNear_m = 1e-9, kNear_rad = 1e-5;
  EXPECT_LT((lying.head<2>() - falling.head<2>()).norm(), kNear_m);
  EXPECT_LT((lying.tail<2>() - falling.tail<2>()).norm(), kNear_rad);
  EXPECT_EQ(lying[2], 0.0);
  EXPECT_EQ((run.values.segment<5>(15) - lying).norm(), 0.0);
}

// Where slip begins and ends its direction settles at once: the path is smooth, its neighbours run
// together faster than a step chosen for the path alone can follow. A fit integrates coarsely and
// its derivatives have to hold there as well.
TEST(RimPredictor, DifferentiatesStickAndSlipIntegratedCoarselyToo) {
  constexpr double kFine = 1e-12, kCoarse = 1e-8, kStep = 1e-5, kAllowed = 1e-3;
  const auto predictor = make_predictor(reference_scene("s10_stick_slip_event"));
  const Eigen::VectorXd at = defaults(*predictor);
  const std::vector<double> t_s{0.3, 0.8, 1.2, 1.6, 2.0};
  PredictRequest request;
  request.t_s = t_s;
  for (const char* name : {"theta_rad", "w2_rad_s", "vx_m_s", "friction", "rolling_friction_m"}) {
    const int i = predictor->index_of(name);
    const double h = kStep * std::abs(at[i]);
    request.tolerance = kFine;
    request.derivatives.clear();
    const auto moved = [&](double by) {
      Eigen::VectorXd values = at;
      values[i] += by;
      return predictor->predict(values, request).values;
    };
    const Eigen::VectorXd difference = (moved(h) - moved(-h)) / (2.0 * h);
    request.tolerance = kCoarse;
    request.derivatives = {i};
    const Eigen::VectorXd ours = predictor->predict(at, request).jacobian.col(0);
    EXPECT_LE((ours - difference).norm(), kAllowed * difference.norm()) << name;
  }
}

// simulate() follows every slip from where it begins, in steps as short as its direction takes to
// settle: 21424 with ten slips. A fit's predictions do without and meet it all the same.
TEST(RimPredictor, DoesNotCreepWhereSlipBegins) {
  constexpr double kTolerance = 1e-8, kNear_m = 1e-7;
  constexpr int kMostSteps = 6000;
  data::Scene scene = reference_scene("s10_stick_slip_event");
  scene.run.tolerance = 1e-11;
  const Trajectory run = simulate(scene);
  const auto column = [&](const std::string& name) -> Eigen::VectorXd {
    const auto at = std::find(run.columns.begin(), run.columns.end(), name);
    return run.values.col(at - run.columns.begin());
  };
  const Eigen::VectorXd times_s = column("t_s");
  const std::vector<double> t_s(times_s.begin(), times_s.end());
  PredictRequest request;
  request.t_s = t_s;
  request.tolerance = kTolerance;
  const auto predictor = make_predictor(scene);
  const Prediction ours = predictor->predict(defaults(*predictor), request);
  EXPECT_LT(ours.steps, kMostSteps);
  const Eigen::VectorXd x_m = column("x_m"), y_m = column("y_m");
  for (Eigen::Index i = 0; i < x_m.size(); ++i)
    ASSERT_LT(std::hypot(ours.values[2 * i] - x_m[i], ours.values[2 * i + 1] - y_m[i]), kNear_m)
        << t_s[static_cast<std::size_t>(i)] << " s";
}

// The record sticks and slips: no single phase takes as many steps as the run.
TEST(RimPredictor, CountsTheStepsOfAllPhasesAgainstTheLimit) {
  const auto predictor = make_predictor(reference_scene("s10_stick_slip_event"));
  const std::vector<double> t_s{0.2, 0.5, 0.8};
  PredictRequest request;
  request.t_s = t_s;
  const Prediction free = predictor->predict(defaults(*predictor), request);
  ASSERT_EQ(free.outcome, Outcome::reached_end);
  request.max_steps = free.steps - 1;
  EXPECT_EQ(predictor->predict(defaults(*predictor), request).outcome, Outcome::step_limit);
}

// Coulomb's law holds a body that does not slip; a floor without friction holds none.
TEST(RimPredictor, SlidesFromRollingOnAFloorWithoutFriction) {
  data::Scene scene = reference_scene("s10_stick_slip_event");
  scene.start.vx_m_s.reset();  // as it rolls
  scene.start.vy_m_s.reset();
  const std::vector<double> t_s{0.02, 0.1, 0.3};
  PredictRequest request;
  request.t_s = t_s;
  request.tolerance = 1e-12;
  scene.model.name = "smooth";
  const auto smooth = make_predictor(scene);
  const Prediction expected = smooth->predict(defaults(*smooth), request);
  scene.model.name = "sliding";
  scene.model.friction = 0.0;
  const auto sliding = make_predictor(scene);
  request.derivatives = {sliding->index_of("friction")};
  const Prediction run = sliding->predict(defaults(*sliding), request);
  ASSERT_EQ(run.outcome, expected.outcome);
  constexpr double kSame_m = 1e-10;  // tolerance 1e-12, of a hundred steps
  EXPECT_LT((run.values - expected.values).cwiseAbs().maxCoeff(), kSame_m);
  EXPECT_TRUE(run.jacobian.allFinite());
}

// Nine parameters and more take two runs, each with steps of its own; either may be the one that
// the limit ends.
TEST(RimPredictor, IsKnownAsFarAsAllItsDerivativesAre) {
  data::Scene scene = reference_scene("s10_stick_slip_event");
  scene.model.rolling_friction_m = scene.model.pivoting_friction_m = 1e-4;
  const auto predictor = make_predictor(scene);
  const std::vector<double> t_s{0.2, 0.4, 0.6, 0.8};
  PredictRequest request;
  request.t_s = t_s;
  request.tolerance = 1e-5;
  const Eigen::VectorXd values = defaults(*predictor);
  for (int i = 0; i < values.size(); ++i) request.derivatives.push_back(i);
  const int first = predictor->predict(values, request).steps;
  for (int order = 0; order < 2; ++order) {
    for (int steps = first; steps <= 2 * first; ++steps) {
      request.max_steps = steps;
      const Prediction run = predictor->predict(values, request);
      for (Eigen::Index row = 0; row < run.values.size(); ++row)
        ASSERT_EQ(run.jacobian.row(row).allFinite(), !std::isnan(run.values[row]))
            << steps << " steps, row " << row;
      ASSERT_EQ(run.outcome == Outcome::reached_end, run.values.allFinite()) << steps;
    }
    std::reverse(request.derivatives.begin(), request.derivatives.end());
  }
}

TEST(RimPredictor, AsksForTheMassOnlyWhenATermNeedsIt) {
  data::Scene scene = reference_scene("s06_roll_disc");
  scene.body->mass_kg.reset();
  scene.body->I_kg_m2.reset();
  scene.body->Is_kg_m2.reset();
  scene.model.rolling_friction_m = 1e-4;
  EXPECT_NO_THROW((void)make_predictor(scene));
  scene.model.air_force_N_s_m = 1e-3;
  EXPECT_THROW((void)make_predictor(scene), InputError);
}

Eigen::VectorXd start_of(const Predictor& predictor, const Eigen::VectorXd& values) {
  constexpr double kStart_s[] = {0.0};
  PredictRequest request;
  request.t_s = kStart_s;
  request.want_end_state = request.rolls_at_first = true;
  return predictor.predict(values, request).end_state;
}

// s08 creeps, under friction that sets in softly, once its skid has ended.
TEST(ABodyThatRollsAtFirst, CreepsAsFastAsTheReferenceDoesAtTheSameAttitudeAndRates) {
  const data::Table table = data::read_table(reference_path("s08_slide_disc", ".csv"));
  const auto predictor = make_predictor(reference_scene("s08_slide_disc"));
  Eigen::VectorXd values = defaults(*predictor);
  const auto set = [&](const char* name, double value) {
    values[predictor->index_of(name)] = value;
  };
  const int vx = predictor->index_of("vx_m_s"), vy = predictor->index_of("vy_m_s");
  constexpr double kCreeps_m_s = 2e-3;  // twice eps_v; a faster slip follows late
  constexpr double kOfSlip = 0.06;
  int rows = 0;
  for (Eigen::Index n = 1; n < table.column("t").size(); ++n) {
    const auto at = [&](const char* name) { return table.column(name)[n]; };
    const double slip_m_s = at("slip");
    if (slip_m_s > kCreeps_m_s || table.column("slip")[n - 1] > kCreeps_m_s) continue;
    for (const auto& [name, column] : {std::pair{"theta_rad", "theta"},
                                       {"phi_rad", "phi"},
                                       {"w1_rad_s", "w1"},
                                       {"w2_rad_s", "w2"},
                                       {"w3_rad_s", "w3"},
                                       {"x_m", "x"},
                                       {"y_m", "y"}})
      set(name, at(column));
    set("vx_m_s", 1e3), set("vy_m_s", -1e3);  // do not count
    const Eigen::VectorXd start = start_of(*predictor, values);
    EXPECT_NEAR(start[vx], at("vx"), kOfSlip * slip_m_s) << "row " << n;
    EXPECT_NEAR(start[vy], at("vy"), kOfSlip * slip_m_s) << "row " << n;
    ++rows;
  }
  EXPECT_GT(rows, 15);
}

}  // namespace
}  // namespace trochoid::model
