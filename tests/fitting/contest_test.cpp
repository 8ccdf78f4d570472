#include "choose/contest.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include "choose/exchange.hpp"
#include "choose/leave_out.hpp"
#include "choose/slide.hpp"
#include "choose/terms.hpp"
#include "problem/problem.hpp"
#include "reference_motion.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::fitting {
namespace {

// A ring of tests/independent that rolls, held back by air and by pivoting friction.
class Contested : public testing::Test {
 protected:
  [[nodiscard]] int term(const std::string& name) const {
    for (std::size_t i = 0; i < ladder_.terms.size(); ++i)
      if (ladder_.terms[i].name == name) return static_cast<int>(i);
    ADD_FAILURE() << name;
    return 0;
  }
  [[nodiscard]] Rung fitted(const Terms& terms) const {
    Rung rung = rung_with(ladder_, terms);
    fit_rung(tracks_, nullptr, nullptr, {}, rung);
    EXPECT_TRUE(rung.fitted) << rung.reason;
    return rung;
  }

  const std::string folder_ = TROCHOID_SOURCE_DIR "/tests/independent/cases/air_force";
  const std::vector<data::Track> tracks_{data::read_track(folder_ + "/track.csv").tracks};
  data::Scene scene_ = data::read_scene(folder_ + "/scene.toml");
  Ladder ladder_ = ladder_of(scene_, false);
  Contest contest_{ladder_, tracks_, {}};
};

// It had stayed as tested beside a rung that was no longer the chosen one.
TEST_F(Contested, ARungThatWasOnlyScoreTestedIsFittedBesideAnother) {
  const int air = term("air force"), pivoting = term("pivoting friction");
  Rungs rungs{fitted({pivoting}), fitted({air})};
  Rung& tested = rungs.emplace_back(rung_with(ladder_, {air, pivoting}));
  tested.fit = rungs[0].fit;
  tested.fitted = tested.by_score_test = true;
  EXPECT_FALSE(is_known(rungs, tested.terms));
  const Neighbour both{tested.terms};
  const auto added = add_neighbours(contest_, std::span(&both, 1), rungs[1], rungs);
  ASSERT_EQ(added.size(), 1u);
  EXPECT_EQ(added[0], &tested);
  EXPECT_EQ(rungs.size(), 3u);
  EXPECT_TRUE(is_known(rungs, tested.terms));
  EXPECT_LT(tested.bic, rungs[1].bic);
  EXPECT_TRUE(add_neighbours(contest_, std::span(&both, 1), rungs[1], rungs).empty());
}

// The search for it had ended elsewhere, and its terms were thought to explain less than nothing.
TEST_F(Contested, ALargerRungThatExplainsLessThanOneItContainsIsFittedAnewFromThere) {
  const int air = term("air force"), pivoting = term("pivoting friction");
  Rungs rungs{fitted({air, pivoting})};
  Rung& larger = rungs.emplace_back(rung_with(ladder_, {air, pivoting, term("rolling friction")}));
  larger.fit = rungs[0].fit;
  larger.fitted = true;
  larger.parameters = rungs[0].parameters + 1;
  larger.bic = larger.fit.bic = rungs[0].bic + 1e3;
  const Rung* chosen = exchange_while_worth(contest_, rungs);
  EXPECT_EQ(chosen, &rungs[0]);
  EXPECT_NE(larger.fit.find("rolling_friction_m"), nullptr);
  const double paid = std::log(chosen->fit.dof + chosen->parameters);
  constexpr double kAtItsMinimum = 0.1;  // of chi-square
  EXPECT_LT(larger.bic, chosen->bic + paid + kAtItsMinimum);
}

// The search for it had ended elsewhere, and a loss that does nothing had been recommended for
// that.
TEST_F(Contested, ASmallerRungThatEndedFarAboveOneThatContainsItIsFittedAnewFromThere) {
  const int air = term("air force"), pivoting = term("pivoting friction");
  const Rung needless = fitted({air, pivoting, term("rolling friction")});
  const auto astray = [&](Rungs& rungs) -> Rung& {
    Rung& smaller = rungs.emplace_back(rung_with(ladder_, {air, pivoting}));
    smaller.fit = needless.fit;
    smaller.fitted = true;
    smaller.parameters = needless.parameters - 1;
    smaller.bic = smaller.fit.bic = needless.bic + 1e3;
    return smaller;
  };
  Rungs left_out{needless}, exchanged{needless};
  const Rung &before = astray(left_out), &beside = astray(exchanged);
  step_down(contest_, left_out[0], left_out);
  EXPECT_LT(before.bic, needless.bic);
  EXPECT_EQ(exchange_while_worth(contest_, exchanged), &beside);
  EXPECT_LT(beside.bic, needless.bic);
  const double bic = beside.bic;
  step_down(contest_, exchanged[0], exchanged);  // where it is as expected it stays
  EXPECT_EQ(beside.bic, bic);
}

// With a wrong radius in the scene the third such search had taken another minute.
TEST_F(Contested, ACreepIsNotSearchedForAfterASearchInVainWithAllThatUsuallyActs) {
  const Rung rolling = fitted({term("air force"), term("pivoting friction")});
  const auto lines_logged = [&](bool in_vain) {
    Rungs rungs{rolling};
    rungs[0].fit.whiteness_p = 1e-6;
    rungs[0].fit.bic = -1e6;  // nothing that is fitted from there does as well
    rungs[0].in_vain = in_vain;
    int lines = 0;
    Contest contest = contest_;
    contest.options.log = [&](const std::string&) { ++lines; };
    EXPECT_FALSE(creep_instead(contest, rungs[0], rungs));
    EXPECT_EQ(rungs.size(), 2u);
    return lines;
  };
  constexpr int kTimesAsMany = 2;  // and mostly far more
  EXPECT_GT(lines_logged(false), kTimesAsMany * lines_logged(true));
}

// A test for whiteness that fails by little is no reason to leave out what the error bars allow
// for: an air couple that stood for another that grows with the square of the speed as well had
// been 14 of them off.
TEST_F(Contested, WhatStandsBesideARungIsFittedWhereResidualsHangTogetherNextToNothing) {
  const auto names_beside = [&](double whiteness_p) {
    Rungs rungs{fitted({term("air force"), term("pivoting friction")})};
    rungs[0].fit.whiteness_p = whiteness_p;
    (void)exchange_while_worth(contest_, rungs);
    std::set<std::string> names;
    for (const Rung& rung : rungs) names.insert(rung.name);
    return names;
  };
  EXPECT_GT(names_beside(0.5).size(), 1u);
  EXPECT_EQ(names_beside(5e-3), names_beside(0.5));
}

// What it loses was only found once it was let slide, with a slip at first that ends between two
// samples: neither how strong friction is came out nor any rate.
TEST_F(Contested, ABodyThatNeedNotSlideRollsWithTheLossesItWasFoundToHave) {
  const Terms losses{term("air force"), term("pivoting friction")};
  const Rung rolling = fitted(losses);
  Terms terms = losses;
  terms.insert(term("sliding"));
  Rungs rungs{rung_with(ladder_, terms)};
  std::map<std::string, double> start = values_of(rolling.fit);
  const auto predictor = model::make_predictor(rungs[0].scene);
  const Eigen::Vector2d v_m_s =
      rolling_velocity(*predictor, fitted_values(*predictor, rolling.fit)).m_s;
  start["friction"] = 0.9;
  start["w3_rad_s"] += 1.0;
  start["vx_m_s"] = v_m_s.x();
  start["vy_m_s"] = v_m_s.y();
  fit_from_values(tracks_, start, {}, rungs[0]);
  ASSERT_TRUE(explains(rungs[0])) << rungs[0].reason;
  ASSERT_TRUE(roll_instead(contest_, rungs[0], rungs));
  const Rung* chosen = simplest_sufficient(ladder_, rungs);
  EXPECT_EQ(chosen->terms, losses);
  EXPECT_NEAR(chosen->fit.chi2, rolling.fit.chi2, 0.1);
  EXPECT_FALSE(roll_instead(contest_, *chosen, rungs));
}

// Residuals that hang together are no ground to fit them, and yet which loss acts may be open.
TEST_F(Contested, UsualLossesBesideTheChosenOnesAreTestedWhereResidualsHangTogether) {
  const int air = term("air force"), pivoting = term("pivoting friction");
  Rungs rungs{fitted({air, pivoting})};
  add_usual_losses(contest_, rungs[0], rungs);
  EXPECT_EQ(rungs.size(), 1u);
  rungs[0].fit.whiteness_p = 1e-6;
  add_usual_losses(contest_, rungs[0], rungs);
  EXPECT_EQ(rungs.size(), 4u);  // with the air's couple, rolling friction, both
  const auto with_rolling = std::find_if(rungs.begin(), rungs.end(), [&](const Rung& rung) {
    return rung.terms == Terms{air, pivoting, term("rolling friction")};
  });
  ASSERT_NE(with_rolling, rungs.end());
  EXPECT_TRUE(with_rolling->by_score_test);
  Rung fit = rung_with(ladder_, with_rolling->terms);
  fit_neighbour(tracks_, rungs[0], {}, fit);
  constexpr double kOfABar = 0.1;
  for (const char* name : {"air_force_N_s_m", "pivoting_friction_m", "rolling_friction_m"})
    EXPECT_NEAR(with_rolling->fit.find(name)->sigma, fit.fit.find(name)->sigma,
                kOfABar * fit.fit.find(name)->sigma)
        << name;
}

// A prior on a loss that the chosen one lacks had been taken for what a model with it gains.
TEST_F(Contested, UsualLossesOfWhichTheSceneSaysMoreAreNotTested) {
  const int air = term("air force"), pivoting = term("pivoting friction");
  for (const int said : {0, 1, 2}) {
    if (said == 0) ladder_.plain.fit.prior["rolling_friction_m"] = {1e-4, 1e-6};
    if (said == 1) ladder_.plain.fit.fixed["rolling_friction_m"] = 1e-4;
    if (said == 2) ladder_.plain.fit.bounds["rolling_friction_m"] = {1e-4, 1e-3};
    Rungs rungs{fitted({air, pivoting})};
    rungs[0].fit.whiteness_p = 1e-6;
    add_usual_losses(contest_, rungs[0], rungs);
    ASSERT_EQ(rungs.size(), 2u);
    EXPECT_EQ(rungs[1].terms, (Terms{air, pivoting, term("air couple")}));
    EXPECT_GT(rungs[1].bic, rungs[0].bic);
    ladder_.plain.fit = scene_.fit;
  }
}

// A search had ended elsewhere before the way up led there: the rung was fitted once more from its
// own solution, and counted twice among those that are as likely.
TEST_F(Contested, OfTwoRungsWithTheSameTermsTheLikelierOneIsKnown) {
  const Rung good = fitted({term("air force"), term("pivoting friction")});
  Rung elsewhere = good;
  elsewhere.bic = elsewhere.fit.bic = good.bic + 1e3;
  for (Rungs rungs : {Rungs{elsewhere, good}, Rungs{good, elsewhere}}) {
    EXPECT_EQ(known_rung(rungs, good.terms)->bic, good.bic);
    EXPECT_FALSE(is_open({good.terms, {values_of(good.fit), 0.0}}, good, rungs));
  }
}

TEST_F(Contested, ARungThatIsFittedAnewWasSearchedForInVainAllTheSame) {
  const Rung known = fitted({term("air force"), term("pivoting friction")});
  Rung rung =
      rung_with(ladder_, {term("air force"), term("pivoting friction"), term("air couple")});
  rung.in_vain = true;
  fit_or_better(contest_, known, {}, rung);
  EXPECT_TRUE(rung.fitted);
  EXPECT_TRUE(rung.in_vain);
}

// A later test, beside another rung, had taken the place of a better one.
TEST_F(Contested, OfTwoScoreTestsForTheSameTermsTheBetterOneStays) {
  Rung tested = rung_with(ladder_, {term("air force")});
  tested.fitted = tested.by_score_test = true;
  Rungs rungs;
  for (const double bic : {20.0, 30.0, 10.0}) {
    tested.bic = bic;
    add_score_tested(tested, rungs);
    ASSERT_EQ(rungs.size(), 1u);
    EXPECT_EQ(rungs[0].bic, std::min(bic, 20.0));
  }
}

TEST_F(Contested, AScoreTestTakesNoPlaceOfARungThatWasFitted) {
  Rung known = rung_with(ladder_, {term("air force")}), tested = known;
  known.fitted = tested.fitted = tested.by_score_test = true;
  known.bic = 20.0;
  tested.bic = 10.0;
  Rungs rungs{known};
  add_score_tested(tested, rungs);
  ASSERT_EQ(rungs.size(), 1u);
  EXPECT_FALSE(rungs[0].by_score_test);
}

// A disc that slides as friction lets it which rises over 1 mm/s. Where all rungs had gone on by
// Coulomb's law it stayed so, and losses stood for what that speed does.
TEST(SlidingContest, AChosenRungWhoseResidualsHangTogetherIsAskedWhetherFrictionSetsInGently) {
  constexpr double kSharp_m = 4e-5, kSlip_m_s = 1e-3;
  NoisyMotion motion = noisy("s08_slide_disc", 1.0, kSharp_m, 2);
  data::ModelSettings nothing;
  nothing.couple_regularisation_rad_s = motion.scene.model.couple_regularisation_rad_s;
  motion.scene.model = nothing;
  const Ladder ladder = ladder_of(motion.scene, false);
  const Contest contest{ladder, std::span(&motion.track, 1), {}};
  Rungs rungs{rung_with(ladder, all_that_usually_acts(ladder, {}))};
  fit_from_values(contest.tracks,
                  {{"theta_rad", 0.96},
                   {"phi_rad", 0.0},
                   {"w1_rad_s", 0.0},
                   {"w2_rad_s", 19.66},
                   {"w3_rad_s", -0.34},
                   {"x_m", 0.0},
                   {"y_m", 0.0},
                   {"vx_m_s", 0.2},
                   {"vy_m_s", 0.05},
                   {"rolling_friction_m", 5e-5},
                   {"pivoting_friction_m", 3e-4},
                   {"friction", 0.3}},
                  {}, rungs[0]);
  ASSERT_TRUE(rungs[0].fit.converged) << rungs[0].fit.reason;
  ASSERT_EQ(rungs[0].fit.find("slip_regularisation_m_s"), nullptr);
  EXPECT_TRUE(soften_instead(contest, rungs[0], rungs));
  const data::FitParameter* gentle = rungs[0].fit.find("slip_regularisation_m_s");
  ASSERT_NE(gentle, nullptr);
  EXPECT_NEAR(gentle->value, kSlip_m_s, 4.0 * gentle->sigma);
  EXPECT_LT(gentle->sigma, 0.2 * kSlip_m_s);
  EXPECT_FALSE(soften_instead(contest, rungs[0], rungs)) << "it does already";
}

}  // namespace
}  // namespace trochoid::fitting
