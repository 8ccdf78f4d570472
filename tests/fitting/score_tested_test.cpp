#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "choose/rung.hpp"
#include "choose/score_test.hpp"
#include "trochoid/data/io.hpp"

// What the tangent plane beside a rung says of others, and how these are fitted from there.
namespace trochoid::fitting {
namespace {

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
