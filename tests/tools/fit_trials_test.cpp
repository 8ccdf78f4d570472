#include "study/fit_trials.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "trochoid/data/error.hpp"
#include "trochoid/fitting/fit.hpp"

namespace trochoid::tools {
namespace {

// Our equations, SUNDIALS' integrator: 60 s of the thesis' base case against its value in quadruple
// precision. Steps of order 8 at 1e-11 over 65 radians of motion: a few 1e-10.
TEST(MadeTracks, FollowTheThesisCaseForAMinute) {
  std::mt19937_64 generator(1);
  const MadeTrack made = make_track(
      {.model = "thesis", .noise = 1e-13, .duration_s = 60.0, .rate_hz = 1.0}, generator);
  ASSERT_EQ(made.track.samples.size(), 61U);
  constexpr double kAllowed = 2e-9;
  EXPECT_NEAR(made.track.samples.back().centre_m.x() / 0.1, 0.9586900216767394, kAllowed);
  EXPECT_NEAR(made.track.samples.back().centre_m.y() / 0.1, 0.2342951380256336, kAllowed);
}

TEST(MadeTracks, AllOfASeedCounts) {
  EXPECT_NE(generator_of(1, 0)(), generator_of((std::uint64_t{1} << 32U) + 1, 0)());
  EXPECT_NE(generator_of(1, 0)(), generator_of(1, 1)());
}

TEST(MadeTracks, BeginWhereTheirTruthSays) {
  for (const char* model : {"top", "thesis", "rolling", "puck"}) {
    std::mt19937_64 generator(1);
    constexpr double kNoise = 1e-9;  // of a body's length, which is below a metre
    const MadeTrack made = make_track({.model = model, .noise = kNoise}, generator);
    ASSERT_GE(made.track.samples.size(), 30U) << model;
    if (!made.truth.contains("x_m")) continue;  // a top's place follows from its angles
    EXPECT_NEAR(made.track.samples[0].centre_m.x(), made.truth.at("x_m"), 6.0 * kNoise) << model;
    EXPECT_NEAR(made.track.samples[0].centre_m.y(), made.truth.at("y_m"), 6.0 * kNoise) << model;
  }
}

TEST(MadeTracks, RefuseAModelTheyDoNotKnow) {
  std::mt19937_64 generator(1);
  EXPECT_THROW((void)make_track({.model = "yoyo"}, generator), InputError);
}

class FitTrials : public testing::Test {
 protected:
  void SetUp() override { fitting::silence_solver_log(); }
};

TEST_F(FitTrials, FindTheTopWithoutAGuess) {
  for (const double noise : {0.01, 0.05}) {
    const std::vector<FitTrial> trials = fit_trials(
        {.model = "top", .noise = noise}, {{"no guess", fitting::Strategy::automatic}}, 25, 3, 0);
    for (const FitTrial& trial : trials)
      EXPECT_TRUE(trial.optimum) << "seed 3, scene " << trial.scene << ", noise " << noise;
  }
}

TEST_F(FitTrials, DoNotDependOnTheNumberOfThreads) {
  const std::vector<FitStrategy> strategies = fit_strategies();
  const auto one = fit_trials({}, strategies, 4, 5, 1), two = fit_trials({}, strategies, 4, 5, 2);
  ASSERT_EQ(one.size(), two.size());
  for (std::size_t i = 0; i < one.size(); ++i) EXPECT_EQ(one[i].chi2, two[i].chi2) << i;
}

TEST_F(FitTrials, ErrorBarsHoldWhatTheyPromise) {
  constexpr int kDraws = 150;
  const Coverage coverage = fit_coverage({.model = "thesis"}, kDraws, 11, 0);
  EXPECT_EQ(coverage.used, kDraws);
  ASSERT_EQ(coverage.parameters, 7);
  // Binomial: sd 1.8 %; seven parameters, so 4 sd.
  for (const auto& [name, share] : coverage.inside_95) EXPECT_NEAR(share, 0.95, 0.072) << name;
  // Chi-square with 7 degrees of freedom: the mean of 150 scatters by 0.31; 4 sd.
  EXPECT_NEAR(coverage.mahalanobis2, 7.0, 1.3);
  EXPECT_NEAR(coverage.likelihood_ratio, 7.0, 1.3);
}

}  // namespace
}  // namespace trochoid::tools
