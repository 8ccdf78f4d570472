#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "choose/rung.hpp"
#include "choose/rung_words.hpp"

// What is said of the rungs beside the chosen one, and what they do to its error bars.
namespace trochoid::fitting {
namespace {

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

// About an upright body each set of losses names its own face; half a turn of phi and twice the
// spin were taken for what it had moved, and the error bars were thousands of times too wide.
TEST(Rivals, ThatNameTheOtherFaceOfAnUprightBodyAreTheSameMotion) {
  const auto standing = [](double theta, double phi, double w1, double w3) {
    std::vector<data::FitParameter> all{loss("theta_rad", theta, 1e-3), loss("phi_rad", phi, 1e-3),
                                        loss("w1_rad_s", w1, 0.01), loss("w3_rad_s", w3, 0.005)};
    all[0].unit = all[1].unit = "rad";
    return all;
  };
  Rung chosen = rung_of({1}, standing(1.569, 0.3, 0.4, -22.0), 100.0, 100.0);
  const Rungs rungs{chosen,
                    rung_of({2}, standing(M_PI - 1.5685, 0.3 + M_PI, -0.4, 22.005), 100.0, 100.0)};
  allow_for_rivals(rungs, rungs[0], chosen.fit);
  EXPECT_LT(chosen.fit.find("w3_rad_s")->sigma, 0.01);
  EXPECT_LT(chosen.fit.find("phi_rad")->sigma, 0.002);
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
  const std::string words = sentence(rungs, rungs[0], {}, data::FitVerdict::good);
  EXPECT_THAT(words,
              testing::HasSubstr("neither needed nor ruled out: with 106 (BIC +6.0), with 107 "
                                 "(BIC +7.0), with 108 (BIC +8.0) and 1 more."));
  EXPECT_THAT(words, testing::Not(testing::HasSubstr("11507")));
}

TEST(Sentence, AsksForTheFactsOfTheSceneWhereAllThatUsuallyActsWasSearchedForInVain) {
  Rungs rungs{rung_of({1}, {loss("air_N_m_s", 1.0, 0.1)}, 100.0, 100.0),
              rung_of({1, 2}, {loss("air_N_m_s", 1.0, 0.1)}, 100.0, 100.0)};
  for (Rung& rung : rungs) rung.fit.model = "puck";  // of a rim's mean path more is said
  const auto asks = testing::HasSubstr("the scale and the frame rate right?");
  const auto words = [&](data::FitVerdict verdict) {
    return sentence(rungs, rungs[0], {}, verdict);
  };
  EXPECT_THAT(words(data::FitVerdict::doubtful), testing::Not(asks));
  rungs[1].in_vain = true;
  EXPECT_THAT(words(data::FitVerdict::doubtful), asks);
  EXPECT_THAT(words(data::FitVerdict::good), testing::Not(asks));
  rungs[0].fit.converged = false;
  EXPECT_THAT(words(data::FitVerdict::unexplained), asks);
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

// A made clip's friction set in over 0.28(6) mm/s by a body that rolled at first, over 0.7(3) by
// one that might slip, and over 1 in truth.
TEST(Rivals, OfTheSameTermsThatSlipAtFirstWidenTheErrorBarsThoughResidualsHangTogether) {
  Rungs rungs{rung_of({1}, {loss("slip_regularisation_m_s", 0.3, 0.06)}, 100.0, 100.0),
              rung_of({1}, {loss("slip_regularisation_m_s", 0.7, 0.3)}, 92.0, 100.0)};
  rungs[0].rolls_at_first = true;
  rungs[0].fit.whiteness_p = 1e-6;
  data::Fit chosen = rungs[0].fit;
  allow_for_rivals(rungs, rungs[0], chosen);
  // Half of the odds are for the other one: (0.4^2 + 0.3^2 - 0.06^2) / 2 further variance.
  EXPECT_NEAR(chosen.parameters[0].sigma, std::sqrt(0.06 * 0.06 + 0.1232), 1e-12);

  rungs[1].rolls_at_first = true;  // just another minimum
  chosen = rungs[0].fit;
  allow_for_rivals(rungs, rungs[0], chosen);
  EXPECT_EQ(chosen.parameters[0].sigma, 0.06);
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

}  // namespace
}  // namespace trochoid::fitting
