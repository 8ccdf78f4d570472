#include "choose/rung.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "choose/held_back.hpp"
#include "choose/rung_words.hpp"
#include "common.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/reference_case.hpp"
#include "trochoid/model/predictor.hpp"
#include "values_with.hpp"

// What a rung of the ladder takes over from the one above it.
namespace trochoid::fitting {
namespace {

data::Scene top_with_drag() {
  data::Scene scene = top();
  scene.model.drag_transverse_N_m_s = scene.model.drag_spin_N_m_s = 1e-6;
  return scene;
}

// A top that loses nothing.
data::Track track_of_a_top() {
  constexpr double kSigma_m = 3e-4;
  const std::map<std::string, double> truth{
      {"a_1_s2", 3.0}, {"b_1_s", 5.0}, {"l_m", 0.1}, {"theta_rad", 0.8}, {"dphi_rad_s", 0.3}};
  const auto predictor = model::make_predictor(top());
  const Eigen::VectorXd values = fitting::values_with(*predictor, truth);
  std::vector<double> t_s;
  for (int i = 0; i < 150; ++i) t_s.push_back(0.03 * i);
  model::PredictRequest request;
  request.t_s = t_s;
  const Eigen::VectorXd path = predictor->predict(values, request).values;
  std::mt19937_64 generator(2);
  std::normal_distribution<double> normal(0.0, kSigma_m);
  data::Track track;
  for (std::size_t i = 0; i < t_s.size(); ++i) {
    data::TrackSample sample;
    sample.t_s = t_s[i];
    sample.centre_m = path.segment<2>(2 * static_cast<Eigen::Index>(i)) +
                      Eigen::Vector2d(normal(generator), normal(generator));
    sample.covariance_m2 = Eigen::Matrix2d::Identity() * kSigma_m * kSigma_m;
    track.samples.push_back(sample);
  }
  return track;
}

TEST(Rung, ThatLacksATermGoesOnFromTheSolutionOfTheOneAbove) {
  const data::Track track = track_of_a_top();
  Rung above, below, alone;
  above.scene = top_with_drag();
  below.scene = alone.scene = top();
  fit_rung(std::span(&track, 1), nullptr, nullptr, {}, above);
  ASSERT_TRUE(above.fitted) << above.reason;
  fit_neighbour(std::span(&track, 1), above, {}, below);
  ASSERT_TRUE(below.fitted) << below.reason;
  EXPECT_EQ(below.fit.start_path, "given") << "else it was searched for anew";
  EXPECT_EQ(below.parameters, above.parameters - 2);
  // What it lacks did not act: the same path, and less to pay for.
  EXPECT_LT(below.bic, above.bic);
  fit_rung(std::span(&track, 1), nullptr, nullptr, {}, alone);
  EXPECT_NEAR(below.fit.chi2, alone.fit.chi2, 0.01) << "the minimum is the same one";
  predict_held_back(std::span(&track, 1), {}, below);
  EXPECT_LT(below.held_back_rms_sigma, 2.0);
}

// A fit that explains nothing may hold that the spin is gone at once. What goes by another law then
// began without bounds, from where nothing can be predicted.
TEST(Rung, TakesOverADragThatLeavesNoSpin) {
  const data::Track track = track_of_a_top();
  Rung above, other;
  above.scene = top_with_drag();
  fit_rung(std::span(&track, 1), nullptr, nullptr, {}, above);
  ASSERT_TRUE(above.fitted) << above.reason;
  for (data::FitParameter& parameter : above.fit.parameters)
    if (parameter.name == "gamma3_1_s") parameter.value = 400.0;
  other.scene = top();
  other.scene.model.drag_spin_quadratic_N_m_s2 = 1e-6;
  fit_neighbour(std::span(&track, 1), above, {}, other);
  EXPECT_TRUE(other.fitted) << other.reason;
}

TEST(Rung, OfSeveralArcsIsSearchedForAnew) {
  data::Fit two;
  two.parameters.push_back({"friction", 0.2, 0.01, "", data::ParameterStatus::free, true, ""});
  two.arcs.resize(2);
  EXPECT_TRUE(values_of(two).empty());
  two.arcs.resize(1);
  EXPECT_EQ(values_of(two).at("friction"), 0.2);
}

// With Coulomb's law its search began ten times as far off, and led nowhere.
TEST(Rung, ThatExtendsOneWhoseFrictionSetsInGentlyMayHaveGentleFrictionToo) {
  const std::string folder = TROCHOID_SOURCE_DIR "/tests/independent/cases/gentle_friction";
  const data::Track track = data::read_track(folder + "/track.csv").tracks.front();
  Rung below, above;
  below.scene = data::read_scene(folder + "/scene.toml");
  below.scene.model.name = "sliding";
  below.scene.model.friction = 0.2;
  below.scene.model.air_linear_N_m_s = Eigen::Vector3d::Constant(1e-7);
  above.scene = below.scene;
  above.scene.model.air_force_N_s_m = 1e-4;
  below.scene.model.slip_regularisation_m_s = 4e-3;
  below.scene.fit.free.emplace_back("slip_regularisation_m_s");
  fit_from_values(std::span(&track, 1),
                  {{"theta_rad", 0.927},
                   {"phi_rad", -1.574},
                   {"w1_rad_s", -0.48},
                   {"w2_rad_s", -38.2},
                   {"w3_rad_s", -3.0},
                   {"x_m", -0.0470},
                   {"y_m", -0.0417},
                   {"vx_m_s", -0.002},
                   {"vy_m_s", -0.167},
                   {"friction", 0.136}},
                  {}, below);
  ASSERT_TRUE(below.fitted) << below.reason;
  EXPECT_FALSE(explains(below));
  fit_rung(std::span(&track, 1), &below, nullptr, {}, above, Reach::from_below);
  ASSERT_TRUE(above.fitted) << above.reason;
  EXPECT_TRUE(explains(above)) << above.fit.verdict_words;
  const data::FitParameter* gentle = above.fit.find("slip_regularisation_m_s");
  ASSERT_NE(gentle, nullptr);
  // The track was made with a quadratic couple of the air, for which a linear one stands here.
  EXPECT_NEAR(gentle->value, 0.004068, 0.05 * 0.004068);
}

data::FitParameter loss(const std::string& name, double value, double sigma) {
  return {name, value, sigma, "m", data::ParameterStatus::free, true, ""};
}

Rung rung_of(std::set<int> terms, std::vector<data::FitParameter> parameters, double aicc,
             double bic) {
  Rung rung;
  rung.terms = std::move(terms);
  rung.fitted = rung.fit.converged = true;
  rung.fit.model = "rolling";
  rung.fit.arcs.resize(1);
  rung.fit.parameters = std::move(parameters);
  const auto count = static_cast<Eigen::Index>(rung.fit.parameters.size());
  rung.fit.covariance = Eigen::MatrixXd::Zero(count, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const data::FitParameter& parameter = rung.fit.parameters[static_cast<std::size_t>(i)];
    rung.fit.covariance_names.push_back(parameter.name);
    rung.fit.covariance(i, i) = parameter.sigma * parameter.sigma;
  }
  rung.aicc = aicc, rung.bic = rung.fit.bic = bic;
  rung.parameters = static_cast<int>(count);
  rung.fit.dof = 1'000'000;  // no rung here ended above one that it contains
  return rung;
}

// A search that ended elsewhere was told of as neither needed nor ruled out, at BIC +11507.
TEST(Sentence, NamesTheLikeliestFewAndNothingThatEndedElsewhere) {
  Rungs rungs{rung_of({1}, {loss("air_N_m_s", 1.0, 0.1)}, 100.0, 100.0)};
  for (const double bic : {109.0, 106.0, 108.0, 107.0, 11507.0}) {
    const int term = 2 + static_cast<int>(rungs.size());
    Rung& larger = rungs.emplace_back(
        rung_of({1, term}, {loss("air_N_m_s", 1.0, 0.1), loss("other_m", 1.0, 0.1)}, bic, bic));
    larger.name = fmt::format("with {:g}", bic);
  }
  for (Rung& rung : rungs) rung.fit.model = "puck";  // of a rim's mean path more is said
  const std::string words = sentence(rungs, rungs[0], {});
  EXPECT_THAT(words,
              testing::HasSubstr("neither needed nor ruled out: with 106 (BIC +6.0), with 107 "
                                 "(BIC +7.0), with 108 (BIC +8.0) and 1 more."));
  EXPECT_THAT(words, testing::Not(testing::HasSubstr("11507")));
}

TEST(Rivals, ThatAreAsLikelyWidenTheErrorBars) {
  const Rungs rungs{rung_of({1}, {loss("rolling_friction_m", 1.0, 0.1)}, 100.0, 100.0),
                    rung_of({2}, {loss("rolling_friction_m", 0.4, 0.1)}, 100.0, 108.0)};
  data::Fit fit = rungs[0].fit;
  allow_for_rivals(rungs, rungs[0], fit);
  // Either model is right with probability one half: 0.6 off half of the time.
  const double expected = std::sqrt(0.1 * 0.1 + 0.5 * 0.6 * 0.6);
  EXPECT_NEAR(fit.parameters[0].sigma, expected, 1e-12);
  EXPECT_NEAR(fit.covariance(0, 0), expected * expected, 1e-12);
  ASSERT_EQ(fit.warnings.size(), 1u);
  EXPECT_NE(fit.warnings[0].find("rolling_friction_m"), std::string::npos);
}

TEST(Rivals, WithoutALossTakeItForNothing) {
  const Rungs rungs{rung_of({1}, {loss("rolling_friction_m", 1.0, 0.1)}, 100.0, 100.0),
                    rung_of({2}, {loss("pivoting_friction_m", 3.0, 0.1)}, 100.0, 100.0)};
  data::Fit fit = rungs[0].fit;
  allow_for_rivals(rungs, rungs[0], fit);
  EXPECT_NEAR(fit.parameters[0].sigma, std::sqrt(0.1 * 0.1 + 0.5), 1e-12);
}

TEST(Rivals, ThatAreRuledOutOrUnexplainedOrOfAnotherLawDoNotCount) {
  Rungs rungs{rung_of({1}, {loss("rolling_friction_m", 1.0, 0.1)}, 100.0, 100.0),
              rung_of({2}, {loss("rolling_friction_m", 0.4, 0.1)}, 100.0, 111.0),
              rung_of({3}, {loss("rolling_friction_m", 0.3, 0.1)}, 80.0, 90.0),
              rung_of({4}, {loss("rolling_friction_m", 0.2, 0.1)}, 100.0, 100.0)};
  rungs[2].fit.converged = false;
  rungs[3].fit.model = "sliding";
  data::Fit fit = rungs[0].fit;
  allow_for_rivals(rungs, rungs[0], fit);
  EXPECT_DOUBLE_EQ(fit.parameters[0].sigma, 0.1);
  EXPECT_TRUE(fit.warnings.empty());
}

// Further terms may only follow a tracker's common errors.
TEST(Rivals, WithATermMoreAreToldAndNotAllowedForWhereResidualsHangTogether) {
  Rungs rungs{
      rung_of({1}, {loss("rolling_friction_m", 1.0, 0.1)}, 100.0, 100.0),
      rung_of({1, 2}, {loss("rolling_friction_m", 0.4, 0.5), loss("gap_viscosity_Pa_s", 1.0, 1.0)},
              98.0, 104.0)};
  rungs[0].fit.whiteness_p = 1e-6;
  data::Fit fit = rungs[0].fit;
  allow_for_rivals(rungs, rungs[0], fit);
  EXPECT_DOUBLE_EQ(fit.parameters[0].sigma, 0.1);
  ASSERT_EQ(fit.warnings.size(), 1u);
  EXPECT_NE(fit.warnings[0].find("rolling_friction_m would be 0.4 ± 0.5; the 1 ± 0.1 given here"),
            std::string::npos)
      << fit.warnings[0];
}

// The simplest model that is not clearly worse is chosen, though one with a term more may be
// better.
TEST(Rivals, WithATermMoreForWhichBicSpeaksWidenTheErrorBarsThoughResidualsHangTogether) {
  Rungs rungs{rung_of({1}, {loss("pivoting_friction_m", 2.1, 0.01)}, 100.0, 100.0),
              rung_of({1, 2}, {loss("pivoting_friction_m", 2.0, 0.04), loss("air_N_m_s", 1.0, 0.3)},
                      90.0, 97.0)};
  rungs[0].fit.whiteness_p = 1e-6;
  const double weight = std::exp(1.5) / (1.0 + std::exp(1.5));
  const double expected =
      std::sqrt((1.0 - weight) * 0.01 * 0.01 + weight * (0.04 * 0.04 + 0.1 * 0.1));
  data::Fit fit = rungs[0].fit;
  allow_for_rivals(rungs, rungs[0], fit);
  EXPECT_NEAR(fit.parameters[0].sigma, expected, 1e-12);
  EXPECT_EQ(fit.warnings.size(), 1u);
}

// It was left out for being larger, not for being wrong.
TEST(Rivals, WithATermMoreThatBicDoesNotRuleOutWidenTheErrorBarsOfWhiteResiduals) {
  Rungs rungs{
      rung_of({1}, {loss("rolling_friction_m", 1.0, 0.1)}, 100.0, 100.0),
      rung_of({1, 2}, {loss("rolling_friction_m", 0.4, 0.5), loss("gap_viscosity_Pa_s", 1.0, 1.0)},
              95.0, 101.0)};
  const double weight = std::exp(-0.5) / (1.0 + std::exp(-0.5));  // by BIC
  const double expected = std::sqrt((1.0 - weight) * 0.1 * 0.1 + weight * (0.5 * 0.5 + 0.6 * 0.6));
  rungs[0].fit.whiteness_p = 0.5;
  data::Fit fit = rungs[0].fit;
  allow_for_rivals(rungs, rungs[0], fit);
  EXPECT_NEAR(fit.parameters[0].sigma, expected, 1e-12);
  EXPECT_NEAR(fit.covariance(0, 0), expected * expected, 1e-12);
  EXPECT_EQ(fit.warnings.size(), 1u);
}

// BIC's evidence against two parameters more is very strong where they fit exactly as well.
TEST(Rivals, ThatAreTooLargeWidenTheErrorBarsOfWhiteResidualsToo) {
  Rungs rungs{
      rung_of({1}, {loss("rolling_friction_m", 1.0, 0.1)}, 100.0, 100.0),
      rung_of({1, 2}, {loss("rolling_friction_m", 0.9, 0.2), loss("gap_viscosity_Pa_s", 1.0, 1.0)},
              102.0, 112.0)};
  const double weight = std::exp(-1.0) / (1.0 + std::exp(-1.0));  // by AICc
  const double expected = std::sqrt((1.0 - weight) * 0.1 * 0.1 + weight * (0.2 * 0.2 + 0.1 * 0.1));
  rungs[0].fit.whiteness_p = 0.5;
  data::Fit fit = rungs[0].fit;
  allow_for_rivals(rungs, rungs[0], fit);
  EXPECT_NEAR(fit.parameters[0].sigma, expected, 1e-12);
  EXPECT_NEAR(fit.covariance(0, 0), expected * expected, 1e-12);
}

TEST(Rivals, WithATermThatCouldBeAnythingWidenTheErrorBarsSoFarAndTheRestIsTold) {
  Rungs rungs{
      rung_of({1}, {loss("rolling_friction_m", 1.0, 0.1), loss("pivoting_friction_m", 2.0, 0.1)},
              100.0, 100.0),
      rung_of({1, 2},
              {loss("rolling_friction_m", 0.0, 0.5), loss("pivoting_friction_m", 3.0, 0.5),
               loss("gap_viscosity_Pa_s", 1.0, 1.0)},
              102.0, 112.0)};
  rungs[1].name = "with a gap layer";
  rungs[0].fit.whiteness_p = 0.5;
  data::Fit fit = rungs[0].fit;
  allow_for_rivals(rungs, rungs[0], fit);
  EXPECT_NEAR(fit.parameters[0].sigma, 0.25, 1e-12);
  EXPECT_NEAR(fit.covariance(0, 0), 0.25 * 0.25, 1e-12);
  // What one loses the other gains.
  EXPECT_LT(fit.covariance(0, 1), -0.5 * 0.25 * 0.25);
  ASSERT_EQ(fit.warnings.size(), 2u);
  EXPECT_EQ(
      fit.warnings[1],
      "with a gap layer is neither needed nor ruled out: with it, rolling_friction_m would be 0 "
      "± 0.5; the 1 ± 0.25 given here is away from that by 4 times its own error bar");
}

// An air couple, of which none fitted best, and on the size of which a filmed ring's pivoting
// friction hung: reported twice as large as it was, at 5.9 of its error bars.
TEST(Rivals, WithATermThatUsuallyActsWidenTheErrorBarsAsFarAsItGoes) {
  std::vector<data::FitParameter> with{loss("pivoting_friction_m", 5.0, 2.4),
                                       loss("air_N_m_s", 0.0, 6.0)};
  Rungs rungs{rung_of({1}, {loss("pivoting_friction_m", 5.0, 0.1)}, 100.0, 100.0),
              rung_of({1, 2}, std::move(with), 104.0, 112.0)};
  rungs[0].fit.whiteness_p = 0.5;
  data::Fit unusual = rungs[0].fit, usual = rungs[0].fit;
  allow_for_rivals(rungs, rungs[0], unusual, {.usual = {1}});
  allow_for_rivals(rungs, rungs[0], usual, {.usual = {1, 2}});
  const double weight = std::exp(-2.0) / (1.0 + std::exp(-2.0));  // by AICc
  EXPECT_NEAR(unusual.parameters[0].sigma, 0.25, 1e-12);
  EXPECT_NEAR(usual.parameters[0].sigma, std::sqrt((1.0 - weight) * 0.1 * 0.1 + weight * 2.4 * 2.4),
              1e-12);
}

// Of filmed bodies residuals are hardly ever white; two that slide had been 5 and 18 of their error
// bars off.
TEST(Rivals, WithATermThatUsuallyActsWidenTheErrorBarsWhereResidualsHangTogetherNextToNothing) {
  std::vector<data::FitParameter> with{loss("pivoting_friction_m", 5.0, 2.4),
                                       loss("air_N_m_s", 0.0, 6.0)};
  Rungs rungs{rung_of({1}, {loss("pivoting_friction_m", 5.0, 0.1)}, 100.0, 100.0),
              rung_of({1, 2}, std::move(with), 104.0, 112.0)};
  const auto bar_with = [&](double whiteness_p, double inflation) {
    rungs[0].fit.whiteness_p = whiteness_p;
    data::Fit fit = rungs[0].fit;
    allow_for_rivals(rungs, rungs[0], fit, {.usual = {1, 2}, .inflation = inflation});
    return fit.parameters[0].sigma;
  };
  EXPECT_GT(bar_with(0.5, 1.0), 0.5);
  EXPECT_EQ(bar_with(1e-6, 1.5), bar_with(0.5, 1.0));
  EXPECT_EQ(bar_with(1e-6, 5.0), 0.1);
}

// A disc in air of which a fifth of the couple grew with the square of the speed: the linear one
// alone had been 14 of its error bars too large.
TEST(Rivals, WithTheOtherLawOfAUsualLossWidenTheErrorBarsAsFarAsItGoes) {
  std::vector<data::FitParameter> with{loss("air_linear_N_m_s", 5.0, 2.4),
                                       loss("air_quadratic_N_m_s2", 0.0, 6.0)};
  Rungs rungs{rung_of({1}, {loss("air_linear_N_m_s", 5.0, 0.1)}, 100.0, 100.0),
              rung_of({1, 2}, std::move(with), 102.0, 112.0)};
  const auto bar_with = [&](double whiteness_p, const RivalGrounds& grounds) {
    rungs[0].fit.whiteness_p = whiteness_p;
    data::Fit fit = rungs[0].fit;
    allow_for_rivals(rungs, rungs[0], fit, grounds);
    return fit.parameters[0].sigma;
  };
  const RivalGrounds another_loss{.usual = {1}, .losses = {"air_linear_N_m_s"}};
  RivalGrounds another_law = another_loss;
  another_law.other_laws = {2};
  const double weight = std::exp(-1.0) / (1.0 + std::exp(-1.0));  // by AICc
  EXPECT_NEAR(bar_with(0.5, another_loss), 0.25, 1e-12);
  EXPECT_NEAR(bar_with(0.5, another_law),
              std::sqrt((1.0 - weight) * 0.1 * 0.1 + weight * 2.4 * 2.4), 1e-12);
  // The tracker's errors, which hang together, may look like it.
  EXPECT_EQ(bar_with(1e-6, another_law), 0.1);
}

// Filmed bodies that slow by air and both frictions at once, of which an air couple alone explained
// short records as well: it had been 6, 24 and 29 of its error bars too large.
TEST(Rivals, WithTermsThatUsuallyActWidenTheErrorBarsWhereNothingTellsLossesFromThem) {
  const auto widened = [](double sigma_there) {
    std::vector<data::FitParameter> with{loss("air_N_m_s", 3.0, sigma_there),
                                         loss("rolling_friction_m", 1.0, 3.0),
                                         loss("w3_rad_s", 7.0, 90.0)};
    Rungs rungs{
        rung_of({1}, {loss("air_N_m_s", 3.4, 0.05), loss("w3_rad_s", 7.0, 1.0)}, 100.0, 100.0),
        rung_of({1, 2}, std::move(with), 102.0, 106.5)};
    rungs[0].fit.whiteness_p = 1e-6;
    data::Fit fit = rungs[0].fit;
    allow_for_rivals(rungs, rungs[0], fit,
                     {.usual = {1, 2}, .losses = {"air_N_m_s"}, .inflation = 5.0});
    return fit;
  };
  const data::Fit acts_in_either = widened(0.1), open = widened(2.0), anything = widened(50.0);
  EXPECT_EQ(acts_in_either.parameters[0].sigma, 0.05);
  EXPECT_EQ(acts_in_either.parameters[1].sigma, 1.0);
  // Both fit as well: that rolling friction acts is not asked.
  EXPECT_NEAR(open.parameters[0].sigma,
              std::sqrt(0.5 * 0.05 * 0.05 + 0.5 * (2.0 * 2.0 + 0.4 * 0.4)), 1e-12);
  EXPECT_NEAR(open.parameters[1].sigma, 2.5, 1e-12);
  // It can give way to the others until nothing is left of it.
  EXPECT_NEAR(anything.parameters[0].sigma, std::sqrt(0.05 * 0.05 + 0.5 * (3.4 * 3.4 + 0.4 * 0.4)),
              1e-12);
}

// By its odds after BIC it had counted for less than one against which the evidence is strong.
TEST(Rivals, WithATermThatUsuallyActsWidenBarsTheMoreTheLessSpeaksAgainstThem) {
  const auto bar_beside = [](double aicc, double bic) {
    Rungs rungs{
        rung_of({1}, {loss("contour_friction_m", 39.0, 0.2)}, 100.0, 100.0),
        rung_of({1, 2},
                {loss("contour_friction_m", 38.0, 2.7), loss("rolling_friction_m", 2.0, 7.0)}, aicc,
                bic)};
    rungs[0].fit.whiteness_p = 0.5;
    data::Fit fit = rungs[0].fit;
    allow_for_rivals(rungs, rungs[0], fit, {.usual = {2}});
    return fit.parameters[0].sigma;
  };
  EXPECT_GT(bar_beside(102.2, 105.1), bar_beside(103.2, 106.1));
  EXPECT_GT(bar_beside(103.2, 106.1), bar_beside(106.2, 109.1));
  const double weight = std::exp(-1.1) / (1.0 + std::exp(-1.1));  // by AICc
  EXPECT_NEAR(bar_beside(102.2, 105.1),
              std::sqrt((1.0 - weight) * 0.2 * 0.2 + weight * (2.7 * 2.7 + 1.0)), 1e-12);
}

TEST(Rivals, ThatAreOtherMinimaOfTheSameModelWidenErrorBarsWithinBounds) {
  Rungs rungs{rung_of({1}, {loss("pivoting_friction_m", 5.0, 0.1)}, 100.0, 100.0),
              rung_of({1}, {loss("pivoting_friction_m", 25.0, 0.1)}, 102.0, 108.0)};
  rungs[0].fit.whiteness_p = 0.5;
  data::Fit fit = rungs[0].fit;
  allow_for_rivals(rungs, rungs[0], fit, {.usual = {1, 2}});
  EXPECT_NEAR(fit.parameters[0].sigma, 0.25, 1e-12);
}

TEST(Rivals, WithATermBesideWhichAnotherOneIsNotDeterminedAreTold) {
  constexpr double kOpen = std::numeric_limits<double>::infinity();
  Rungs rungs{
      rung_of({1}, {loss("pivoting_friction_m", 5.0, 0.1)}, 100.0, 100.0),
      rung_of({1, 2}, {loss("pivoting_friction_m", 5.0, kOpen), loss("air_N_m_s", 0.0, kOpen)},
              104.0, 112.0)};
  rungs[1].name = "with air";
  data::Fit fit = rungs[0].fit;
  allow_for_rivals(rungs, rungs[0], fit, {.usual = {1, 2}});
  ASSERT_FALSE(fit.warnings.empty());
  EXPECT_EQ(fit.warnings.back(),
            "with air is neither needed nor ruled out: with it, pivoting_friction_m would not be "
            "determined; the 5 ± 0.1 given here is what holds without it");
}

// Nothing moves where none of the further loss fits best, and still it leaves another one open.
TEST(Rivals, WithATermThatLeavesAnotherOneOpenAreTold) {
  Rungs rungs{rung_of({1}, {loss("pivoting_friction_m", 5.0, 0.1)}, 100.0, 100.0),
              rung_of({1, 2}, {loss("pivoting_friction_m", 5.0, 2.4), loss("air_N_m_s", 0.0, 6.0)},
                      104.0, 112.0)};
  rungs[0].fit.whiteness_p = 0.5;
  rungs[1].name = "with air";
  data::Fit fit = rungs[0].fit;
  allow_for_rivals(rungs, rungs[0], fit);
  ASSERT_EQ(fit.warnings.size(), 2u);
  EXPECT_EQ(fit.warnings[1],
            "with air is neither needed nor ruled out: with it, pivoting_friction_m would be 5 ± "
            "2.4; the 5 ± 0.25 given here is what holds without it");
}

// Full error bars are had for the chosen one alone: like is compared with like.
TEST(Rivals, AddAsMuchToAnErrorBarThatIsWiderForOtherReasons) {
  Rungs rungs{
      rung_of({1}, {loss("rolling_friction_m", 1.0, 0.1)}, 100.0, 100.0),
      rung_of({1, 2}, {loss("rolling_friction_m", 1.1, 0.2), loss("gap_viscosity_Pa_s", 1.0, 1.0)},
              101.0, 104.0)};
  rungs[0].fit.whiteness_p = 0.5;
  data::Fit by_curvature = rungs[0].fit, full = rungs[0].fit;
  constexpr double kWider = 0.3;
  full.parameters[0].sigma = kWider;
  full.covariance(0, 0) = kWider * kWider;
  allow_for_rivals(rungs, rungs[0], by_curvature);
  allow_for_rivals(rungs, rungs[0], full);
  EXPECT_GT(by_curvature.covariance(0, 0), 0.1 * 0.1);
  EXPECT_NEAR(full.covariance(0, 0) - kWider * kWider, by_curvature.covariance(0, 0) - 0.1 * 0.1,
              1e-12);
}

// Which may be another one than the likeliest.
TEST(Rivals, ThatMoveAParameterMostAreNamedBesideIt) {
  Rungs rungs{rung_of({1}, {loss("rolling_friction_m", 1.0, 0.1)}, 100.0, 100.0),
              rung_of({2}, {loss("rolling_friction_m", 1.0, 0.1)}, 98.0, 100.0),
              rung_of({3}, {loss("rolling_friction_m", 0.2, 0.1)}, 101.0, 103.0)};
  rungs[1].name = "which agrees";
  rungs[2].name = "which does not";
  data::Fit fit = rungs[0].fit;
  allow_for_rivals(rungs, rungs[0], fit);
  ASSERT_EQ(fit.warnings.size(), 1u);
  EXPECT_NE(fit.warnings[0].find("above all which does not"), std::string::npos) << fit.warnings[0];
}

// Where Coulomb's law does beside one loss more, nothing is said of what it does not have.
TEST(Rivals, WithATermMoreMayDoWithoutAParameter) {
  const Rungs rungs{rung_of({1}, {loss("slip_regularisation_m_s", 1e-3, 1e-4)}, 100.0, 100.0),
                    rung_of({1, 2}, {loss("gap_viscosity_Pa_s", 1.0, 1.0)}, 98.0, 104.0)};
  data::Fit fit = rungs[0].fit;
  allow_for_rivals(rungs, rungs[0], fit);
  EXPECT_TRUE(fit.warnings.empty());
}

// A ring of tests/independent that rolls, held back by air and by pivoting friction.
class ScoreTested : public testing::Test {
 protected:
  [[nodiscard]] Rung rung_with(const std::set<std::string>& losses) const {
    Rung rung;
    rung.scene = data::read_scene(folder_ + "/scene.toml");
    rung.scene.model.name = "rolling";
    if (losses.contains("air")) rung.scene.model.air_force_N_s_m = 3e-3;
    if (losses.contains("pivoting")) rung.scene.model.pivoting_friction_m = 5e-5;
    if (losses.contains("rolling")) rung.scene.model.rolling_friction_m = 5e-5;
    return rung;
  }
  [[nodiscard]] Rung fitted(const std::set<std::string>& losses) const {
    return fitted(losses, tracks_);
  }
  [[nodiscard]] Rung fitted(const std::set<std::string>& losses,
                            const std::vector<data::Track>& tracks) const {
    Rung rung = rung_with(losses);
    fit_rung(tracks, nullptr, nullptr, {}, rung);
    EXPECT_TRUE(rung.fitted) << rung.reason;
    return rung;
  }

  const std::string folder_ = TROCHOID_SOURCE_DIR "/tests/independent/cases/air_force";
  const std::vector<data::Track> tracks_{data::read_track(folder_ + "/track.csv").tracks};
};

constexpr int kAll = 0;  // none of the larger model's losses taken away

TEST_F(ScoreTested, GainIsWhatAMissingLossThenBrings) {
  const Rung known = fitted({"air"}), with = fitted({"air", "pivoting"});
  const auto test = score_test(tracks_, known, {}, rung_with({"air", "pivoting"}), {{kAll, {}}});
  ASSERT_TRUE(test);
  const double share = 1.0 - test->instead.at(kAll).chi2 / test->before;
  const double gained = 1.0 - with.fit.chi2 / known.fit.chi2;
  ASSERT_GT(gained, 0.05);
  EXPECT_NEAR(share, gained, 0.2 * gained);
  EXPECT_EQ(test->instead.at(kAll).parameters, 1);
}

TEST_F(ScoreTested, GainIsToldOfSeveralRecordingsToo) {
  const auto half = static_cast<std::ptrdiff_t>(tracks_.front().samples.size() / 2);
  std::vector<data::Track> halves(2, tracks_.front());
  halves[0].samples.resize(half);
  halves[1].samples.erase(halves[1].samples.begin(), halves[1].samples.begin() + half);
  const Rung known = fitted({"air"}, halves), with = fitted({"air", "pivoting"}, halves);
  const auto test = score_test(halves, known, {}, rung_with({"air", "pivoting"}), {{kAll, {}}});
  ASSERT_TRUE(test);
  const double share = 1.0 - test->instead.at(kAll).chi2 / test->before;
  const double gained = 1.0 - with.fit.chi2 / known.fit.chi2;
  ASSERT_GT(gained, 0.01);
  EXPECT_NEAR(share, gained, 0.2 * gained);
}

TEST_F(ScoreTested, GainIsNothingOfALossThatDoesNotAct) {
  constexpr double kVeryStrong = 10.0;
  const Rung known = fitted({"air", "pivoting"});
  const std::map<int, std::set<std::string>> others{
      {kAll, {}}, {1, {"air_force_N_s_m"}}, {2, {"pivoting_friction_m"}}};
  const auto test =
      score_test(tracks_, known, {}, rung_with({"air", "pivoting", "rolling"}), others);
  ASSERT_TRUE(test);
  EXPECT_GT(test->instead.at(kAll).chi2, test->before - kVeryStrong);
  // Nor does it do for one that acts.
  for (const int acting : {1, 2}) {
    EXPECT_GT(test->instead.at(acting).chi2, test->before + kVeryStrong);
    EXPECT_EQ(test->instead.at(acting).parameters, 0);
  }
}

TEST_F(ScoreTested, ErrorBarsAreAboutThoseOfAFitWithTheAddedLoss) {
  const std::set<std::string> losses{"air", "pivoting", "rolling"};
  const Rung known = fitted({"air", "pivoting"}), with = fitted(losses);
  const auto test = score_test(tracks_, known, {}, rung_with(losses), {{kAll, {}}});
  ASSERT_TRUE(test);
  Rung tested = rung_with(losses);
  take_from_score_test(known, *test, test->instead.at(kAll), 1.0, tested);
  double widest = 1.0;
  for (const data::FitParameter& parameter : with.fit.parameters) {
    const data::FitParameter* there = tested.fit.find(parameter.name);
    ASSERT_NE(there, nullptr) << parameter.name;
    EXPECT_NEAR(there->sigma, parameter.sigma, 0.3 * parameter.sigma) << parameter.name;
    if (const data::FitParameter* before = known.fit.find(parameter.name))
      widest = std::max(widest, there->sigma / before->sigma);
  }
  EXPECT_GT(widest, 1.5);  // of a loss that has to share
}

TEST_F(ScoreTested, GainIsToldOfLossesThatTogetherTakeThePlaceOfOthers) {
  const Rung known = fitted({"rolling"});
  const auto test = score_test(tracks_, known, {}, rung_with({"air", "pivoting", "rolling"}),
                               {{kAll, {}}, {1, {"rolling_friction_m"}}, {2, {"air_force_N_s_m"}}});
  ASSERT_TRUE(test);
  const ScoreTest::Change &both = test->instead.at(1), &one = test->instead.at(2);
  EXPECT_LT(both.chi2, test->before - kVeryStrong);
  EXPECT_EQ(both.parameters, 1);
  EXPECT_GE(one.chi2, test->instead.at(kAll).chi2);
  // How far error bars hold what is added is asked of what is added.
  EXPECT_GT(one.moves, 0.0);
  EXPECT_EQ(both.moves, 0.0);
}

// Beside a sliding body such a fit took most of a minute to end where it began.
TEST_F(ScoreTested, RungsAreOnlyThatWhereALossWouldGainNothing) {
  const Rung known = fitted({"air", "pivoting"}), with = fitted({"air", "pivoting", "rolling"});
  Rung rung = rung_with({"air", "pivoting", "rolling"});
  const auto test = score_test(tracks_, known, {}, rung, {{kAll, {}}});
  ASSERT_TRUE(test);
  constexpr double kInflation = 1.0, kMuchTheSame = 1.0;  // of BIC
  take_from_score_test(known, *test, test->instead.at(kAll), kInflation, rung);
  EXPECT_TRUE(rung.fitted);
  EXPECT_FALSE(rung.reason.empty());
  EXPECT_EQ(rung.parameters, with.parameters);
  EXPECT_NEAR(rung.bic - known.bic, with.bic - known.bic, kMuchTheSame);
  for (const data::FitParameter& parameter : known.fit.parameters) {
    const data::FitParameter &told = *rung.fit.find(parameter.name),
                             &found = *with.fit.find(parameter.name);
    EXPECT_GE(told.sigma, parameter.sigma) << parameter.name;
    EXPECT_NEAR(told.value, found.value, 0.5 * found.sigma) << parameter.name;
    EXPECT_NEAR(told.sigma, found.sigma, 0.5 * found.sigma) << parameter.name;
  }
  // Without the loss itself others had taken it for nothing.
  const data::FitParameter &told = *rung.fit.find("rolling_friction_m"),
                           &found = *with.fit.find("rolling_friction_m");
  EXPECT_EQ(told.unit, found.unit);
  EXPECT_NEAR(told.value, found.value, 0.5 * found.sigma);
  EXPECT_NEAR(told.sigma, found.sigma, 0.5 * found.sigma);
}

// A camera that a prior holds is no way out: the fit of the larger model holds it too.
TEST_F(ScoreTested, LossesHoldWhatIsKnownBeforehand) {
  Rung known = rung_with({"air", "pivoting"}), larger = rung_with({"air", "pivoting", "rolling"});
  for (Rung* rung : {&known, &larger}) rung->scene.fit.prior["scale"] = {1.1, 0.05};
  fit_rung(tracks_, nullptr, nullptr, {}, known);
  ASSERT_TRUE(known.fitted) << known.reason;
  const auto test = score_test(tracks_, known, {}, larger, {});
  ASSERT_TRUE(test);
  constexpr double kNearly = 0.9;  // robust weights take some of it
  EXPECT_GT(test->before, kNearly * test->rows);
}

TEST_F(ScoreTested, LossesSayWhereTheMinimumIsThen) {
  const Rung known = fitted({"air"}), with = fitted({"air", "pivoting"});
  const auto test = score_test(tracks_, known, {}, rung_with({"air", "pivoting"}), {{kAll, {}}});
  ASSERT_TRUE(test);
  const std::map<std::string, double> there = values_of(with.fit), here = values_of(known.fit);
  constexpr double kNearer = 0.5;  // the plane is not the valley
  for (const char* name : {"air_force_N_s_m", "w2_rad_s", "w3_rad_s"})
    EXPECT_LT(std::abs(test->instead.at(kAll).values.at(name) - there.at(name)),
              kNearer * std::abs(here.at(name) - there.at(name)))
        << name;
  EXPECT_GT(test->instead.at(kAll).values.at("pivoting_friction_m"),
            kNearer * there.at("pivoting_friction_m"));
  // What stood for the loss is off by more than its error bar.
  EXPECT_GT(test->instead.at(kAll).moves, 1.0);
}

TEST_F(ScoreTested, GainIsUntoldWhereTheTrackIsTooShortForIt) {
  const Rung known = fitted({"air"});
  std::vector<data::Track> few = tracks_;
  few.front().samples.resize(2);
  EXPECT_FALSE(score_test(few, known, {}, rung_with({"air", "pivoting"}), {}));
}

// Number 01 of class A, seed 1009: air couples and an air force, for which rolling friction stood.
class Exchanged : public testing::Test {
 protected:
  [[nodiscard]] Rung rung_with(bool rolling, bool force) const {
    Rung rung;
    rung.scene = data::read_scene(folder_ + "/scene.toml");
    rung.scene.model.name = "rolling";
    rung.scene.model.air_linear_N_m_s = Eigen::Vector3d::Constant(2e-7);
    if (rolling) rung.scene.model.rolling_friction_m = 8e-5;
    if (force) rung.scene.model.air_force_N_s_m = 2e-3;
    return rung;
  }
  const std::string folder_ = TROCHOID_SOURCE_DIR "/tests/independent/cases/exchanged_loss";
  const std::vector<data::Track> tracks_{data::read_track(folder_ + "/track.csv").tracks};
};

// From two per cent of a typical air force it ended where most of the motion is left unexplained,
// and rolling friction, which does not act, was reported at 6 of its error bars.
TEST_F(Exchanged, LossesStartWhereTheTangentPlaneHasTheirMinimum) {
  Rung known = rung_with(true, false);
  fit_from_values(tracks_,
                  {{"theta_rad", 1.28},
                   {"phi_rad", -2.8217},
                   {"w1_rad_s", 0.1677},
                   {"w2_rad_s", 4.5574},
                   {"w3_rad_s", -15.36},
                   {"x_m", 0.052137},
                   {"y_m", 0.082912},
                   {"rolling_friction_m", 1.2285e-5},
                   {"air_linear_N_m_s[1]", 3.8e-9},
                   {"air_linear_N_m_s[3]", 1.02e-8}},
                  {}, known);
  ASSERT_TRUE(known.fit.converged) << known.fit.reason;
  const auto test =
      score_test(tracks_, known, {}, rung_with(true, true), {{1, {"rolling_friction_m"}}});
  ASSERT_TRUE(test);
  const ScoreTest::Change& change = test->instead.at(1);
  EXPECT_FALSE(change.values.contains("rolling_friction_m"));
  Rung other = rung_with(false, true);
  fit_neighbour(tracks_, known, {}, other, {change.values, change.chi2 - test->before});
  ASSERT_TRUE(other.fit.converged) << other.fit.reason;
  EXPECT_LT(other.bic, known.bic);
}

// Expectations may be wrong: then the solution of the known rung is the start.
TEST_F(ScoreTested, NeighboursNeedNotBeWhereTheyAreExpected) {
  const Rung known = fitted({"air"});
  Rung with = rung_with({"air", "pivoting"});
  Nearby astray{values_of(known.fit), 0.0};
  astray.values["w2_rad_s"] *= -1.0;
  fit_neighbour(tracks_, known, {}, with, astray);
  EXPECT_TRUE(with.fit.converged) << with.fit.reason;
  EXPECT_LT(with.bic, known.bic);
}

// A disc of tests/independent that spins in place while it slides. The friction that sets in gently
// is dear to follow: the search for it had run out before it came near the path.
TEST(SlidingRung, FindsABodyThatSpinsInPlaceWhileItSlides) {
  const std::string folder = TROCHOID_SOURCE_DIR "/tests/independent/cases/spins_while_it_slides";
  const auto tracks = data::read_track(folder + "/track.csv").tracks;
  constexpr double kOrder_N_m_s = 2e-6, kOrder_m = 7e-5;  // seconds to a minute to a standstill
  Rung rung;
  rung.scene = data::read_scene(folder + "/scene.toml");
  rung.scene.model.name = "sliding";
  rung.scene.model.friction = 0.3;
  rung.scene.model.air_linear_N_m_s = Eigen::Vector3d::Constant(kOrder_N_m_s);
  rung.scene.model.rolling_friction_m = rung.scene.model.pivoting_friction_m = kOrder_m;
  fit_rung(tracks, nullptr, nullptr, {}, rung);
  EXPECT_TRUE(rung.fit.converged) << rung.fit.reason;
}

// The gentle law lets a body creep that rolls at first: the search for it led nowhere within a
// minute.
TEST(SlidingRung, OfABodyThatRollsAtFirstIsSearchedForByCoulombsLaw) {
  const std::string folder = TROCHOID_SOURCE_DIR "/tests/independent/cases/spins_while_it_slides";
  auto tracks = data::read_track(folder + "/track.csv").tracks;
  constexpr std::size_t kFew = 40;
  tracks.front().samples.resize(kFew);
  for (const bool rolls_first : {false, true}) {
    Rung rung;
    rung.scene = data::read_scene(folder + "/scene.toml");
    rung.scene.model.name = "sliding";
    rung.scene.model.friction = 0.3;
    rung.scene.model.rolling_friction_m = 7e-5;
    if (rolls_first) rung.first_part.values["theta_rad"] = 1.0;
    std::vector<std::string> lines;
    FitOptions logged;
    logged.log = [&](const std::string& line) { lines.push_back(line); };
    fit_rung(tracks, nullptr, nullptr, logged, rung);
    ASSERT_FALSE(lines.empty());
    EXPECT_EQ(lines.front().starts_with("Coulomb's law"), rolls_first) << lines.front();
    EXPECT_TRUE(rung.fit.converged) << rung.fit.reason;
  }
}

// A disc of tests/independent that rolls first and slides later.
class SlidesLater : public testing::Test {
 protected:
  SlidesLater() {
    rung_.scene = data::read_scene(folder_ + "/scene.toml");
    rung_.scene.model.name = "sliding";
    rung_.scene.model.friction = 0.3313;
    rung_.scene.model.rolling_friction_m = 1.27e-4;
    rung_.scene.model.contour_friction_m = 1.85e-5;
  }
  // From the fit of the same model whose centre begins as fast as that, so much beside its rolling.
  [[nodiscard]] Rung fitted(const data::Track& track, double slip_m_s) const {
    Rung below = rung_, rung = rung_;
    std::map<std::string, double> start = start_;
    start["vx_m_s"] += slip_m_s;
    fit_from_values(std::span(&track, 1), start, {}, below);
    EXPECT_TRUE(below.fit.converged) << below.reason;
    EXPECT_FALSE(below.rolls_at_first);
    fit_rung(std::span(&track, 1), &below, nullptr, {}, rung);
    EXPECT_TRUE(rung.fit.converged) << rung.reason;
    return rung;
  }

  const std::string folder_ = TROCHOID_SOURCE_DIR "/tests/independent/cases/slides_later";
  const std::map<std::string, double> start_{
      {"theta_rad", 1.2785}, {"phi_rad", -2.9611}, {"w1_rad_s", -0.959},
      {"w2_rad_s", -2.549},  {"w3_rad_s", 5.1303}, {"x_m", -0.02115},
      {"y_m", -0.09757},     {"vx_m_s", 0.2793},   {"vy_m_s", 0.0024}};
  Rung rung_;
};

// A slip that is over within a few samples came out anywhere, and all that goes with it.
TEST_F(SlidesLater, RollsFromTheBeginningWhereNothingSpeaksForASlip) {
  const Rung rung = fitted(data::read_track(folder_ + "/track.csv").tracks.front(), 0.0);
  EXPECT_TRUE(rung.rolls_at_first);
  EXPECT_EQ(rung.fit.find("vx_m_s")->status, data::ParameterStatus::derived);
}

// It was fitted with Coulomb's law, however softly friction sets in beside it.
TEST_F(SlidesLater, StaysAsTestedBesideOneThatRollsAtFirst) {
  const data::Track track = data::read_track(folder_ + "/track.csv").tracks.front();
  const Rung known = fitted(track, 0.0);
  Rung rung = rung_;
  rung.fit = known.fit;
  rung.fitted = rung.by_score_test = true;
  rung.bic = known.bic + 1.0;
  begin_as(std::span(&track, 1), known, {}, rung);
  EXPECT_TRUE(rung.by_score_test);
  EXPECT_FALSE(rung.rolls_at_first);
  EXPECT_EQ(rung.bic, known.bic + 1.0);
}

// It lasts for little more than a sample, and leaves the body a millimetre elsewhere.
TEST_F(SlidesLater, SlipsAtFirstWhereThatIsSeen) {
  constexpr double kSlip_m_s = -0.09;
  constexpr int kSamples = 40;
  data::Track track = data::read_track(folder_ + "/track.csv").tracks.front();
  track.samples.resize(kSamples);
  std::vector<double> t_s;
  for (const data::TrackSample& sample : track.samples) t_s.push_back(sample.t_s);
  std::map<std::string, double> truth = start_;
  truth["vx_m_s"] += kSlip_m_s;
  const auto predictor = model::make_predictor(rung_.scene);
  model::PredictRequest request;
  request.t_s = t_s;
  request.observables.push_back(model::Observable::theta_rad);
  request.observables.push_back(model::Observable::phi_rad);
  const Eigen::VectorXd path =
      predictor->predict(fitting::values_with(*predictor, truth), request).values;
  ASSERT_EQ(path.size(), static_cast<Eigen::Index>(4 * t_s.size()));
  std::mt19937_64 generator(3);
  std::normal_distribution<double> normal;
  for (std::size_t i = 0; i < t_s.size(); ++i) {
    const auto at = path.segment<4>(4 * static_cast<Eigen::Index>(i));
    data::TrackSample& sample = track.samples[i];
    const double sigma_m = std::sqrt(sample.covariance_m2(0, 0));
    sample.centre_m =
        at.head<2>() + sigma_m * Eigen::Vector2d(normal(generator), normal(generator));
    sample.theta->value_rad = at[2] + sample.theta->sigma_rad * normal(generator);
    sample.phi->value_rad = at[3] + sample.phi->sigma_rad * normal(generator);
  }
  const Rung rung = fitted(track, kSlip_m_s);
  EXPECT_FALSE(rung.rolls_at_first);
  const data::FitParameter* speed = rung.fit.find("vx_m_s");
  EXPECT_NEAR(speed->value, start_.at("vx_m_s") + kSlip_m_s, 4.0 * speed->sigma);
}

// Rows of s08, between two skids and on: a disc that creeps at first, as softly as friction sets
// in.
data::Track creeping_first(const data::Table& reference) {
  constexpr Eigen::Index kFrom = 31, kTo = 79;
  constexpr double kSigma_m = 2e-5, kSigma_rad = 2e-3;
  std::mt19937_64 generator(5);
  std::normal_distribution<double> normal;
  data::Track track;
  for (Eigen::Index i = kFrom; i < kTo; ++i) {
    const auto at = [&](const char* name, double sigma) {
      return reference.column(name)[i] + sigma * normal(generator);
    };
    data::TrackSample& sample = track.samples.emplace_back();
    sample.t_s = reference.column("t")[i];
    sample.centre_m = {at("x", kSigma_m), at("y", kSigma_m)};
    sample.covariance_m2 = kSigma_m * kSigma_m * Eigen::Matrix2d::Identity();
    sample.theta = data::MeasuredAngle{at("theta", kSigma_rad), kSigma_rad};
    sample.phi = data::MeasuredAngle{at("phi", kSigma_rad), kSigma_rad};
  }
  return track;
}

// A slip that friction ends within a millisecond is not seen, and what goes with it was uncertain
// by whole turns a second.
TEST(SlidingRung, OfABodyThatCreepsAtFirstHasTheRatesItIsSeenWith) {
  const std::string file = TROCHOID_SOURCE_DIR "/data/reference/s08_slide_disc";
  const data::Table reference = data::read_table(file + ".csv");
  const data::Track track = creeping_first(reference);
  Rung rung;
  rung.scene = data::read_reference_case(file + ".json").scene;
  rung.scene.start = {};
  rung.scene.fit.free.emplace_back("slip_regularisation_m_s");
  std::map<std::string, double> truth;
  for (const auto& [name, column] : {std::pair{"theta_rad", "theta"},
                                     {"phi_rad", "phi"},
                                     {"w1_rad_s", "w1"},
                                     {"w2_rad_s", "w2"},
                                     {"w3_rad_s", "w3"},
                                     {"x_m", "x"},
                                     {"y_m", "y"},
                                     {"vx_m_s", "vx"},
                                     {"vy_m_s", "vy"}})
    truth[name] = reference.column(column)[31];
  Rung below = rung;
  fit_from_values(std::span(&track, 1), truth, {}, below);
  ASSERT_TRUE(below.fit.converged) << below.reason;
  rung = below;
  let_roll_at_first(std::span(&track, 1), {}, rung);
  ASSERT_TRUE(rung.fit.converged) << rung.reason;
  EXPECT_TRUE(rung.rolls_at_first);
  EXPECT_EQ(rung.fit.find("vx_m_s")->status, data::ParameterStatus::derived);
  for (const auto& [name, value] : truth) {
    const data::FitParameter* found = rung.fit.find(name);
    ASSERT_NE(found, nullptr) << name;
    const double off = std::remainder(found->value - value, 2.0 * std::numbers::pi);
    EXPECT_LT(std::abs(off), 4.0 * found->sigma) << name;
    if (name.ends_with("_s")) {
      EXPECT_LT(found->sigma, 0.3 * below.fit.find(name)->sigma) << name;
    }
  }
}

// Integrated more coarsely its path has its minimum elsewhere: the way there and back took most of
// the steps.
TEST_F(ScoreTested, NeighboursAreIntegratedAsFinelyAsTheRungTheyStartFrom) {
  Rung known = fitted({"air"}), with = rung_with({"air", "pivoting"}), coarse = with;
  fit_neighbour(tracks_, known, {}, coarse);
  ASSERT_TRUE(coarse.fit.converged) << coarse.fit.reason;
  known.settled.tolerance = 0.1 * coarse.settled.tolerance;
  fit_neighbour(tracks_, known, {}, with);
  ASSERT_TRUE(with.fit.converged) << with.fit.reason;
  EXPECT_LE(with.settled.tolerance, known.settled.tolerance);
  EXPECT_NEAR(with.fit.chi2, coarse.fit.chi2, 0.1);
}

// Minutes went into the last digits of a path that was not the body's.
TEST_F(ScoreTested, APathThatLeavesMostOfTheMotionUnexplainedIsNotPolished) {
  std::vector<std::string> lines;
  FitOptions astray;
  astray.log = [&](const std::string& line) { lines.push_back(line); };
  astray.strategy = Strategy::single;
  astray.start = values_of(fitted({"air"}).fit);
  astray.start["w2_rad_s"] *= -1.0;
  const Rung rung = rung_with({"air", "pivoting"});
  const data::Fit found = fit(tracks_, rung.scene, astray);
  ASSERT_EQ(found.verdict, data::FitVerdict::unexplained);
  const auto weighing = std::find(lines.begin(), lines.end(), "weighing the samples");
  ASSERT_NE(weighing, lines.end());
  EXPECT_EQ(std::count_if(weighing, lines.end(),
                          [](const std::string& line) { return line.find("rows") != line.npos; }),
            0);
}

// A little of a loss turns a body by whole turns seconds later: let act at a share of what it may
// be, it lost the path, and the way back took most of the time.
TEST_F(ScoreTested, ALossThatWasGoneIsLetActWithoutLosingThePath) {
  std::vector<std::string> lines;
  FitOptions from;
  from.log = [&](const std::string& line) { lines.push_back(line); };
  from.strategy = Strategy::single;
  from.start = values_of(fitted({"air"}).fit);
  from.start["pivoting_friction_m"] = 1e-12;
  Rung rung = rung_with({"air", "pivoting"});
  rung.scene.model.pivoting_friction_m = 2e-2;  // it may be a thousand times what it is
  const data::Fit found = fit(tracks_, rung.scene, from);
  EXPECT_GT(found.find("pivoting_friction_m")->value, 1e-7);
  double last = 0.0;
  int compared = 0;
  for (const std::string& line : lines) {
    const std::size_t at = line.find("chi2 "), to = line.find(" -> ");
    if (line == "weighing the samples") break;
    if (at == line.npos || to == line.npos) continue;
    const double first = std::stod(line.substr(at + 5));
    if (last > 0.0) {
      EXPECT_LT(first, 2.1 * last) << line;
      ++compared;
    }
    last = std::stod(line.substr(to + 4));
  }
  EXPECT_GT(compared, 0);
}

}  // namespace
}  // namespace trochoid::fitting
