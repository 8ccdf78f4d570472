#include "trochoid/fitting/compare.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>
#include <set>
#include <tuple>
#include <utility>

#include "common.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/reference_case.hpp"
#include "trochoid/model/predictor.hpp"
#include "values_with.hpp"

namespace trochoid::fitting {
namespace {

using Values = std::map<std::string, double>;

// Samples of the scene's model at the given values, with noise on positions [m] and spin angle
// [rad].
data::Track track_of(const data::Scene& scene, const Values& given, double duration_s, int samples,
                     double sigma, std::uint64_t seed) {
  const auto predictor = model::make_predictor(scene);
  const Eigen::VectorXd values = fitting::values_with(*predictor, given);
  std::vector<double> t_s;
  for (int i = 0; i < samples; ++i) t_s.push_back(duration_s * i / (samples - 1));
  model::PredictRequest request;
  request.t_s = t_s;
  request.observables.push_back(model::Observable::psi_rad);
  request.tolerance = 1e-11;
  const model::Prediction exact = predictor->predict(values, request);
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal(0.0, sigma);
  data::Track track;
  for (int i = 0; i < samples; ++i) {
    data::TrackSample sample;
    sample.t_s = t_s[i];
    sample.centre_m = exact.values.segment<2>(3 * i);
    sample.centre_m.x() += normal(generator);
    sample.centre_m.y() += normal(generator);
    sample.covariance_m2 = Eigen::Matrix2d::Identity() * sigma * sigma;
    if (predictor->model_name() == "pivot")
      sample.psi = data::MeasuredAngle{exact.values[3 * i + 2] + normal(generator), sigma};
    track.samples.push_back(sample);
  }
  return track;
}

Comparison compare_one(const data::Track& track, const data::Scene& scene) {
  return compare(std::span(&track, 1), scene);
}

data::Scene spin_down() {
  data::Scene scene;
  scene.body.emplace().radius_m = 0.1;
  scene.support.kind = data::SupportKind::pivot;
  scene.model.name = "pivot";
  return scene;
}

TEST(Compare, FindsTheLawsOfASpinDownAndLeavesTheOthersOut) {
  const Values start{{"w3_rad_s", 20.0}};
  data::Scene dry = spin_down(), both = spin_down();
  dry.model.spin_down_dry_rad_s2 = both.model.spin_down_dry_rad_s2 = 0.8;
  both.model.spin_down_quadratic_1_rad = 0.02;
  const Comparison one = compare_one(track_of(dry, start, 15.0, 150, 0.01, 1), spin_down());
  EXPECT_TRUE(one.scene.model.spin_down_dry_rad_s2);
  EXPECT_FALSE(one.scene.model.spin_down_viscous_1_s);
  EXPECT_FALSE(one.scene.model.spin_down_quadratic_1_rad);
  const Comparison two = compare_one(track_of(both, start, 10.0, 150, 0.01, 2), spin_down());
  EXPECT_TRUE(two.scene.model.spin_down_dry_rad_s2);
  EXPECT_TRUE(two.scene.model.spin_down_quadratic_1_rad);
  EXPECT_FALSE(two.scene.model.spin_down_viscous_1_s);
  EXPECT_THAT(two.fit.recommendation, testing::HasSubstr("dry couple"));
  EXPECT_NEAR(two.fit.find("spin_down_dry_rad_s2")->value, 0.8,
              4.0 * two.fit.find("spin_down_dry_rad_s2")->sigma);
  EXPECT_EQ(std::count_if(two.fit.comparison.begin(), two.fit.comparison.end(),
                          [](const data::ModelScore& score) { return score.recommended; }),
            1);
}

TEST(Compare, FindsTheWeightBesideTheAxisAndFrictionThatWeakens) {
  data::Scene truth = spin_down();
  truth.model.spin_down_dry_rad_s2 = 0.12;
  truth.model.spin_down_weakening_s_rad = 0.2;
  truth.model.spin_down_imbalance_sin_rad_s2 = 0.03;
  truth.model.spin_down_imbalance_cos_rad_s2 = -0.02;
  const data::Track track = track_of(truth, {{"w3_rad_s", 3.0}}, 35.0, 1000, 1e-3, 5);
  const Comparison found = compare_one(track, spin_down());
  EXPECT_EQ(found.fit.verdict, data::FitVerdict::good);
  for (const auto& [name, value] : Values{{"spin_down_dry_rad_s2", 0.12},
                                          {"spin_down_weakening_s_rad", 0.2},
                                          {"spin_down_imbalance_sin_rad_s2", 0.03},
                                          {"spin_down_imbalance_cos_rad_s2", -0.02}}) {
    const data::FitParameter* parameter = found.fit.find(name);
    ASSERT_NE(parameter, nullptr) << name;
    EXPECT_NEAR(parameter->value, value, 4.0 * parameter->sigma) << name;
    EXPECT_LT(parameter->sigma, 0.02 * std::abs(value)) << name;
  }
  // Each model stands in the table once.
  std::set<std::pair<double, int>> scores;
  for (const data::ModelScore& score : found.fit.comparison)
    EXPECT_TRUE(scores.emplace(score.bic, score.parameters).second) << score.model;
}

// Dry and viscous friction together look quadratic at first, and all three trade with each other
// along a bent valley: its end, and that the first is not needed then, have to be found.
TEST(Compare, FindsTwoLossesThatAThirdStoodInFor) {
  for (const auto& [w3_rad_s, dry, viscous] :
       {std::tuple{-25.6, 0.876, 0.0317}, {31.0, 0.42, 0.045}, {-50.0, 0.9, 0.03}}) {
    data::Scene truth = spin_down();
    truth.model.spin_down_dry_rad_s2 = dry;
    truth.model.spin_down_viscous_1_s = viscous;
    const data::Track track = track_of(truth, {{"w3_rad_s", w3_rad_s}}, 10.0, 300, 0.01, 7);
    const Comparison found = compare_one(track, spin_down());
    ASSERT_TRUE(found.fit.converged) << found.fit.reason;
    EXPECT_FALSE(found.scene.model.spin_down_quadratic_1_rad) << w3_rad_s;
    for (const auto& [name, value] :
         Values{{"spin_down_dry_rad_s2", dry}, {"spin_down_viscous_1_s", viscous}}) {
      const data::FitParameter* parameter = found.fit.find(name);
      ASSERT_NE(parameter, nullptr) << name;
      EXPECT_NEAR(parameter->value, value, 4.0 * parameter->sigma) << name << ", " << w3_rad_s;
    }
  }
}

// Five standard deviations of a swing of two thousandths of a radian: what it does to the path of a
// disc without a weight turns faster than that path's own steps.
TEST(Compare, FindsALightWeightOnAFastDisc) {
  data::Scene truth = spin_down();
  truth.model.spin_down_viscous_1_s = 0.042;
  truth.model.spin_down_imbalance_sin_rad_s2 = 2.4;
  truth.model.spin_down_imbalance_cos_rad_s2 = 1.1;
  const data::Track track = track_of(truth, {{"w3_rad_s", -39.7}}, 10.0, 1200, 0.01, 8);
  const Comparison found = compare_one(track, spin_down());
  for (const auto& [name, value] : Values{{"spin_down_imbalance_sin_rad_s2", 2.4},
                                          {"spin_down_imbalance_cos_rad_s2", 1.1},
                                          {"w3_rad_s", -39.7}}) {
    const data::FitParameter* parameter = found.fit.find(name);
    ASSERT_NE(parameter, nullptr) << name;
    EXPECT_NEAR(parameter->value, value, 4.0 * parameter->sigma) << name;
  }
}

// Held for a second, brought to speed by hand within half a second, then let go.
TEST(Compare, LeavesOutWhatComesBeforeTheRelease) {
  data::Scene truth = spin_down();
  truth.model.spin_down_dry_rad_s2 = 0.8;
  const data::Track free = track_of(truth, {{"w3_rad_s", -20.0}}, 12.0, 300, 0.01, 6);
  const double step_s = free.samples[1].t_s, push_s = 0.5, held_s = 1.0;
  data::Track track;
  for (int i = 0; i * step_s < held_s + push_s; ++i) {
    data::TrackSample sample = free.samples[0];
    sample.t_s = i * step_s;
    const double pushed_s = std::max(0.0, sample.t_s - held_s);
    sample.psi->value_rad += 10.0 * push_s - 20.0 * pushed_s * pushed_s / (2.0 * push_s);
    track.samples.push_back(sample);
  }
  for (data::TrackSample sample : free.samples) {
    sample.t_s += held_s + push_s;
    if (sample.t_s > track.samples.back().t_s) track.samples.push_back(sample);
  }
  data::Scene plain = truth;
  plain.model.spin_down_dry_rad_s2 = 0.1;
  const data::Fit fitted = fit(std::span(&track, 1), plain, {});
  EXPECT_TRUE(fitted.converged) << fitted.reason;
  EXPECT_GE(fitted.arcs.at(0).from_s, held_s + push_s - step_s);
  EXPECT_LT(fitted.arcs.at(0).from_s, held_s + push_s + 1.0);
  EXPECT_NEAR(fitted.find("spin_down_dry_rad_s2")->value, 0.8,
              4.0 * fitted.find("spin_down_dry_rad_s2")->sigma);
  EXPECT_THAT(fitted.warnings, testing::Contains(testing::HasSubstr("begins at rest")));
}

TEST(Compare, SaysWhetherATopNeedsDrag) {
  const data::Scene plain = top();
  data::Scene drag = top();
  drag.model.drag_transverse_N_m_s = drag.model.drag_spin_N_m_s = 1e-6;
  const Values start{{"a_1_s2", 3.0},     {"b_1_s", 5.0},      {"l_m", 0.1},
                     {"theta_rad", 0.8},  {"dphi_rad_s", 0.3}, {"gamma1_1_s", 0.03},
                     {"gamma3_1_s", 0.02}};
  EXPECT_EQ(compare_one(track_of(plain, start, 6.0, 200, 5e-4, 3), plain).fit.comparison.size(),
            5U);
  EXPECT_FALSE(compare_one(track_of(plain, start, 6.0, 200, 5e-4, 3), plain)
                   .scene.model.drag_spin_N_m_s.has_value());
  const Comparison found = compare_one(track_of(drag, start, 6.0, 200, 5e-4, 4), plain);
  ASSERT_TRUE(found.scene.model.drag_spin_N_m_s.has_value()) << found.fit.recommendation;
  EXPECT_LT(std::abs(found.fit.find("gamma1_1_s")->value - 0.03),
            4.0 * found.fit.find("gamma1_1_s")->sigma);
}

// A law that another one has replaced comes back beside it with little left to do. It began at a
// size that turned the axis astray, ended in a minimum hundreds of chi-square above that without it
// and was called neither needed nor ruled out.
TEST(Compare, AddsALawOfATopsSpinBesideAnotherForWhatThatCosts) {
  data::Scene quadratic = top();
  quadratic.model.drag_transverse_N_m_s = quadratic.model.drag_spin_quadratic_N_m_s2 = 1e-6;
  const Values start{{"a_1_s2", 147.15},          {"b_1_s", 30.0},     {"l_m", 0.03},
                     {"theta_rad", 0.6},          {"dphi_rad_s", 2.0}, {"gamma1_1_s", 0.01},
                     {"gamma3_quadratic", 8.9e-4}};
  const Comparison found = compare_one(track_of(quadratic, start, 10.0, 1001, 2e-4, 1), top());
  ASSERT_TRUE(found.scene.model.drag_spin_quadratic_N_m_s2.has_value()) << found.fit.recommendation;
  int larger = 0;
  for (const data::ModelScore& row : found.fit.comparison) {
    if (!row.model.ends_with("quadratic spin drag") || row.parameters != 10) continue;
    ++larger;
    EXPECT_LT(row.bic, found.fit.bic + std::log(2002.0) + 1.0) << row.model;
  }
  EXPECT_EQ(larger, 2) << found.fit.recommendation;
}

// A body that is now here, now there moves as no top does. Whatever becomes of a model, it is
// listed.
TEST(Compare, ListsModelsThatExplainNothingWithTheirReason) {
  data::Track jumping = track_of(top(), {{"theta_rad", 0.8}}, 2.0, 60, 1e-4, 9);
  std::mt19937_64 generator(9);
  std::uniform_real_distribution<double> anywhere(-0.1, 0.1);
  for (data::TrackSample& sample : jumping.samples)
    sample.centre_m = Eigen::Vector2d{anywhere(generator), anywhere(generator)};
  const Comparison none = compare_one(jumping, top());
  ASSERT_EQ(none.fit.comparison.size(), 5U);
  for (const data::ModelScore& score : none.fit.comparison) {
    EXPECT_FALSE(score.reason.empty()) << score.model;
  }
}

// A disc on a pivot with nothing said of its tilt: turning face-on, or a top?
TEST(Compare, TakesABodyThatStraysFromItsPivotForATop) {
  const Values start{{"a_1_s2", 3.0},    {"b_1_s", 5.0},      {"l_m", 0.1},
                     {"theta_rad", 0.8}, {"dphi_rad_s", 0.3}, {"psi_rad", 0.1}};
  data::Track track = track_of(top(), start, 6.0, 200, 5e-4, 8);
  data::Scene scene = top();
  scene.model.name = "auto";
  data::Body& body = scene.body.emplace();
  body.kind = data::BodyKind::disc;
  body.radius_m = 0.04;
  body.thickness_m = 0.004;
  const Comparison found = compare_one(track, scene);
  EXPECT_EQ(found.fit.model, "top") << found.fit.recommendation;
  EXPECT_TRUE(found.fit.converged) << found.fit.reason;
  // The other law, named against the evidence, has nothing to say of where the body is.
  for (data::TrackSample& sample : track.samples)
    sample.psi = data::MeasuredAngle{20.0 * sample.t_s, 0.01};
  scene.model.name = "pivot";
  const data::Fit turning = fit(std::span(&track, 1), scene);
  EXPECT_EQ(turning.verdict, data::FitVerdict::unexplained) << turning.verdict_words;
  EXPECT_THAT(turning.verdict_words, testing::HasSubstr("strays"));
}

// One wrong place in three hundred, a hand before the time chosen, or the scatter of places whose
// errors are not stated made a top of a disc that turned where it was.
TEST(Compare, TakesNoGlitchNoHandAndNoScatterForAWayFromThePivot) {
  data::Scene scene = spin_down();
  scene.model.spin_down_dry_rad_s2 = 0.8;
  const data::Track still = track_of(scene, {{"w3_rad_s", 20.0}}, 6.0, 300, 0.01, 13);
  const auto verdict = [&](const data::Track& track, const FitOptions& options = {}) {
    return fit(std::span(&track, 1), scene, options).verdict_words;
  };
  const auto explained = testing::StartsWith("the model explains the track");
  data::Track glitch = still, led = still, unstated = still;
  glitch.samples[150].centre_m.x() = 10.0;
  EXPECT_THAT(verdict(glitch), explained);
  FitOptions later;
  later.from = "1.0";
  for (data::TrackSample& sample : led.samples)
    if (sample.t_s < 0.9) sample.centre_m.x() += 1.0 - sample.t_s;
  EXPECT_THAT(verdict(led), testing::HasSubstr("strays"));
  EXPECT_THAT(verdict(led, later), explained);
  scene.body.reset();
  for (data::TrackSample& sample : unstated.samples) sample.covariance_m2.setConstant(NAN);
  EXPECT_THAT(verdict(unstated), explained);
}

// A track that counts whole turns tells them apart where a turn takes less than two frames: the
// angle was brought within half a turn of the one before, and no start led to the motion.
TEST(Compare, FollowsASpinOfMoreThanHalfATurnFromFrameToFrame) {
  constexpr double kSpin_rad_s = 400.0, kDry_rad_s2 = 20.0;
  data::Scene scene = spin_down();
  scene.model.spin_down_dry_rad_s2 = kDry_rad_s2;
  const data::Track track = track_of(scene, {{"w3_rad_s", kSpin_rad_s}}, 6.0, 601, 0.01, 14);
  scene.model.spin_down_dry_rad_s2 = 0.1;
  const data::Fit turning = fit(std::span(&track, 1), scene);
  ASSERT_TRUE(turning.converged) << turning.reason;
  EXPECT_LT(pull(turning, "w3_rad_s", kSpin_rad_s), kFar);
  EXPECT_LT(pull(turning, "spin_down_dry_rad_s2", kDry_rad_s2), kFar);
}

data::Scene ring() {
  data::Scene scene;
  data::Body& body = scene.body.emplace();
  body.kind = data::BodyKind::ring;
  body.radius_m = 0.03;
  body.inner_radius_m = 0.027;
  body.thickness_m = 0.008;
  body.mass_kg = 0.034;
  scene.model.name = "rolling";
  return scene;
}

TEST(Compare, TellsWhichFrictionSlowsARing) {
  data::Scene truth = ring();
  truth.model.pivoting_friction_m = 2e-4;
  const Values start{{"theta_rad", 1.2}, {"w1_rad_s", 0.3}, {"w2_rad_s", 24.0}, {"w3_rad_s", 4.0}};
  const Comparison found = compare_one(track_of(truth, start, 1.5, 150, 2e-4, 5), ring());
  EXPECT_TRUE(found.scene.model.pivoting_friction_m) << found.fit.recommendation;
  EXPECT_FALSE(found.scene.model.air_linear_N_m_s) << found.fit.recommendation;
  EXPECT_THAT(found.fit.recommendation, testing::HasSubstr("neither needed nor ruled out"));
  const data::FitParameter* friction = found.fit.find("pivoting_friction_m");
  ASSERT_NE(friction, nullptr);
  EXPECT_LT(std::abs(friction->value - 2e-4), 4.0 * friction->sigma);
  for (const data::ModelScore& score : found.fit.comparison)
    if (score.recommended) {
      EXPECT_LT(score.held_back_rms_sigma, 3.0);
    }
}

// From an independent integrator, with noise added: a disc on ice, as a tracker would see it.
TEST(Compare, FindsThatAFloorHasNoFrictionAtAll) {
  const std::string base = std::string(TROCHOID_SOURCE_DIR) + "/data/reference/s05_smooth_disc";
  const data::Table table = data::read_table(base + ".csv");
  constexpr int kSamples = 51;
  constexpr double kSigma_m = 2e-4, kSigma_rad = 0.02;
  std::mt19937_64 generator(11);
  std::normal_distribution<double> normal;
  data::Track track;
  for (int i = 0; i < kSamples; ++i) {
    const auto at = [&](const char* name) { return table.column(name)[i]; };
    data::TrackSample sample;
    sample.t_s = at("t");
    sample.centre_m = Eigen::Vector2d(at("x"), at("y")) +
                      kSigma_m * Eigen::Vector2d{normal(generator), normal(generator)};
    sample.covariance_m2 = Eigen::Matrix2d::Identity() * kSigma_m * kSigma_m;
    sample.theta = data::MeasuredAngle{at("theta") + kSigma_rad * normal(generator), kSigma_rad};
    sample.phi = data::MeasuredAngle{at("phi") + kSigma_rad * normal(generator), kSigma_rad};
    track.samples.push_back(sample);
  }
  data::Scene scene;
  scene.body = data::read_reference_case(base + ".json").scene.body;
  scene.model.name = "auto";
  const Comparison found = compare_one(track, scene);
  EXPECT_EQ(found.fit.model, "smooth") << found.fit.recommendation;
  EXPECT_TRUE(found.fit.converged) << found.fit.reason;
  const data::FitParameter* spin = found.fit.find("w3_rad_s");
  ASSERT_NE(spin, nullptr);
  EXPECT_LT(std::abs(spin->value - 8.0), 4.0 * spin->sigma);
}

TEST(Compare, SaysWhatTurnsARingRetrograde) {
  data::Scene truth = ring();
  truth.model.pivoting_friction_m = 5e-4;
  const Values start{{"theta_rad", 1.2}, {"w1_rad_s", 0.0}, {"w2_rad_s", 24.0}, {"w3_rad_s", 4.4}};
  const Comparison found = compare_one(track_of(truth, start, 2.5, 200, 2e-4, 6), ring());
  EXPECT_THAT(found.fit.recommendation, testing::HasSubstr("turns retrograde at t ="));
  EXPECT_THAT(found.fit.recommendation, testing::HasSubstr("pivoting friction explains it"));
}

// Contour friction slows the body, but leaves its mean path prograde.
TEST(Compare, SaysWhichOfTheLossesTurnsARingRetrograde) {
  data::Scene truth = ring();
  truth.model.pivoting_friction_m = 5e-4;
  truth.model.contour_friction_m = 1e-4;
  const Values start{{"theta_rad", 1.2}, {"w1_rad_s", 0.0}, {"w2_rad_s", 24.0}, {"w3_rad_s", 4.4}};
  const Comparison found = compare_one(track_of(truth, start, 2.5, 200, 2e-4, 6), ring());
  EXPECT_THAT(found.fit.recommendation,
              testing::HasSubstr("; pivoting friction explains it, without contour friction it "
                                 "would turn all the same"));
}

// A scene made for one model may be compared with others.
TEST(Compare, HeedsWhatIsSaidOfParametersThatOnlySomeOfTheModelsHave) {
  data::Scene scene = spin_down();
  scene.model.spin_down_dry_rad_s2 = 1.0;
  const data::Track track =
      track_of(scene, {{"w3_rad_s", 20.0}, {"spin_down_dry_rad_s2", 1.0}}, 4.0, 200, 1e-3, 3);
  scene.fit.free = {"spin_down_dry_rad_s2"};
  scene.fit.bounds = {{"spin_down_viscous_1_s", {0.0, 0.5}}};
  const Comparison found = compare_one(track, scene);
  EXPECT_EQ(found.fit.model, "pivot");
  EXPECT_NEAR(found.fit.find("spin_down_dry_rad_s2")->value, 1.0, 0.01);
  scene.fit.free = {"spin_down_dri"};
  EXPECT_THAT([&] { (void)compare_one(track, scene); },
              testing::ThrowsMessage<InputError>(testing::HasSubstr(
                  "[fit] free: the models compared have no parameter 'spin_down_dri'")));
}

}  // namespace
}  // namespace trochoid::fitting
