#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>
#include <random>
#include <set>

#include "common.hpp"
#include "judge/adequacy.hpp"
#include "judge/second_thoughts.hpp"
#include "problem/prepare.hpp"
#include "trochoid/fitting/fit.hpp"
#include "trochoid/model/predictor.hpp"
#include "values_with.hpp"

// What a fit says of its own worth.
namespace trochoid::fitting {
namespace {

constexpr double kUsualSigma_m = 2e-4;
constexpr int kUsualSamples = 180;
constexpr double kRate_Hz = 60.0;

data::Scene rolling_disc() {
  data::Scene scene;
  data::Body& body = scene.body.emplace();
  body.kind = data::BodyKind::disc;
  body.radius_m = 0.0375;
  body.thickness_m = 0.005;
  scene.model.name = "rolling";
  return scene;
}

using Path = std::function<Eigen::Vector2d(double t_s)>;
using Noise = std::function<double()>;

Noise white(double sigma_m, std::uint64_t seed) {
  return [generator = std::mt19937_64(seed),
          normal = std::normal_distribution<double>(0.0, sigma_m)]() mutable {
    return normal(generator);
  };
}

data::Track track_of(const Path& path, Noise noise, int samples = kUsualSamples) {
  data::Track track;
  for (int i = 0; i < samples; ++i) {
    data::TrackSample sample;
    sample.t_s = i / kRate_Hz;
    sample.centre_m = path(sample.t_s);
    sample.centre_m.x() += noise();
    sample.centre_m.y() += noise();
    sample.covariance_m2 = Eigen::Matrix2d::Identity() * kUsualSigma_m * kUsualSigma_m;
    track.samples.push_back(sample);
  }
  return track;
}

const std::map<std::string, double> kNutating{
    {"a_1_s2", 8.0}, {"b_1_s", 6.0}, {"l_m", 0.1}, {"theta_rad", 0.8}};

// A nutating top, 2.5 nutations in the three seconds.
Path nutating_top(const std::map<std::string, double>& given = kNutating,
                  const data::Scene& scene = top(), int samples = kUsualSamples) {
  const auto predictor = model::make_predictor(scene);
  const Eigen::VectorXd values = values_with(*predictor, given);
  std::vector<double> t_s;
  for (int i = 0; i < samples; ++i) t_s.push_back(i / kRate_Hz);
  model::PredictRequest request;
  request.t_s = t_s;
  const Eigen::VectorXd xy = predictor->predict(values, request).values;
  return [xy](double t) -> Eigen::Vector2d {
    return xy.segment<2>(2 * static_cast<Eigen::Index>(std::lround(t * kRate_Hz)));
  };
}

TEST(Verdict, IsGoodForATopInWhiteNoise) {
  const data::Fit fit = fit_of(track_of(nutating_top(), white(kUsualSigma_m, 1)), top());
  EXPECT_TRUE(fit.converged);
  EXPECT_EQ(fit.verdict, data::FitVerdict::good) << fit.verdict_words;
}

TEST(Verdict, NamesCorrelatedResidualsAndWhatTheyCost) {
  Noise noise = [white = white(0.5 * kUsualSigma_m, 2), x = 0.0, y = 0.0]() mutable {
    std::swap(x, y);  // two coordinates, each with a memory of ten samples
    return x = 0.9 * x + white();
  };
  const data::Fit fit = fit_of(track_of(nutating_top(), noise), top());
  EXPECT_TRUE(fit.converged);
  EXPECT_EQ(fit.verdict, data::FitVerdict::good_correlated) << fit.verdict_words;
  EXPECT_THAT(fit.verdict_words, testing::HasSubstr("widened"));
}

// A wobble of two thirds of the noise, seven samples long: neighbours are not alike, but what is
// left is not noise either.
TEST(Verdict, DoesNotTakeAWobbleForNoise) {
  const auto wobbling = [path = nutating_top()](double t) -> Eigen::Vector2d {
    const double phase = 2.0 * M_PI * kRate_Hz * t / 7.0;
    return path(t) + 0.9 * kUsualSigma_m * Eigen::Vector2d(std::cos(phase), std::sin(phase));
  };
  const data::Fit fit = fit_of(track_of(wobbling, white(kUsualSigma_m, 7)), top());
  EXPECT_TRUE(fit.converged);
  EXPECT_LT(fit.whiteness_p, 1e-3);
  EXPECT_EQ(fit.verdict, data::FitVerdict::good_correlated) << fit.verdict_words;
}

// Linear drag in the place of a quadratic one leaves hardly more than the noise, and was called
// good_correlated; halves of the record tell that it is not what slows the top.
TEST(Verdict, IsDoubtfulWhereHalvesOfTheRecordAskForOtherParameters) {
  data::Scene quadratic = top(), linear = top();
  quadratic.model.drag_spin_quadratic_N_m_s2 = 1e-6;
  linear.model.drag_spin_N_m_s = 1e-6;
  constexpr int kLong = 600;
  auto truth = kNutating;
  truth["gamma3_quadratic"] = 0.004;
  const data::Track track =
      track_of(nutating_top(truth, quadratic, kLong), white(kUsualSigma_m, 13), kLong);
  const data::Fit right = fit_of(track, quadratic), wrong = fit_of(track, linear);
  EXPECT_EQ(right.verdict, data::FitVerdict::good) << right.verdict_words;
  EXPECT_LT(wrong.noise_scale, 1.5);
  EXPECT_EQ(wrong.verdict, data::FitVerdict::doubtful) << wrong.verdict_words;
  EXPECT_THAT(wrong.verdict_words, testing::HasSubstr("second half"));
}

// Residuals of three times the noise, whose sigmas somebody stated: followed, but not explained.
TEST(Verdict, IsDoubtfulWhereTheModelLeavesSeveralTimesTheNoise) {
  const auto drifting = [path = nutating_top()](double t) -> Eigen::Vector2d {
    return path(t) +
           5.0 * kUsualSigma_m * Eigen::Vector2d(std::cos(9.7 * t), std::cos(11.3 * t + 1.0));
  };
  const data::Fit fit = fit_of(track_of(drifting, white(kUsualSigma_m, 8)), top());
  EXPECT_EQ(fit.verdict, data::FitVerdict::doubtful) << fit.verdict_words;
  EXPECT_THAT(fit.verdict_words, testing::HasSubstr("does not explain it"));
  EXPECT_THAT(fit.verdict_words, testing::HasSubstr("times their noise"));
}

constexpr double kGivenUp = 0.01, kStandsOut = 0.5;  // of the weight in full

// What is said of a search that ended with these values, where these samples count for less.
data::Fit fit_at(const data::Track& track, const std::map<std::string, double>& found,
                 bool cut_short, const std::set<int>& given_up = {}, double weight = kGivenUp) {
  const auto predictor = model::make_predictor(top());
  FitOptions options;
  options.start = found;
  Problem problem = prepare(std::span(&track, 1), *predictor, top(), options);
  problem.row_weights[0] = Eigen::VectorXd::Ones(problem.rows());
  for (const Reading& reading : problem.arcs[0].readings)
    if (given_up.contains(reading.sample))
      problem.row_weights[0].segment<2>(reading.row).setConstant(weight);
  Solution solution;
  solution.u = problem.start();
  solution.usable = solution.converged = true;
  data::Fit fit;
  judge(problem, solution, {}, cut_short, fit);
  doubt_as_a_whole(problem, solution.u, {}, {}, fit);
  return fit;
}

data::FitVerdict verdict_at(const data::Track& track, const std::map<std::string, double>& found,
                            bool cut_short, const std::set<int>& given_up = {}) {
  return fit_at(track, found, cut_short, given_up).verdict;
}

// The same, less, where the search ended before anything passed: another valley may explain it.
TEST(Verdict, IsUnexplainedWhereACutShortSearchLeavesMoreThanTheNoise) {
  const auto verdict = [](double drift_m, bool cut_short) {
    const auto drifting = [path = nutating_top(), drift_m](double t) -> Eigen::Vector2d {
      return path(t) + drift_m * Eigen::Vector2d(std::cos(9.7 * t), std::cos(11.3 * t + 1.0));
    };
    return verdict_at(track_of(drifting, white(kUsualSigma_m, 8)), kNutating, cut_short);
  };
  EXPECT_EQ(verdict(2.0 * kUsualSigma_m, true), data::FitVerdict::unexplained);
  EXPECT_EQ(verdict(2.0 * kUsualSigma_m, false), data::FitVerdict::good);
  EXPECT_EQ(verdict(0.0, true), data::FitVerdict::good);
}

// A top that touches something in the last part of the film and is pushed along.
Path pushed(double from_s) {
  return [path = nutating_top(), from_s](double t) -> Eigen::Vector2d {
    constexpr double kPush_m_s2 = 0.4;
    const double since_s = std::max(0.0, t - from_s);
    return path(t) + Eigen::Vector2d(0.5 * kPush_m_s2 * since_s * since_s, 0.0);
  };
}

TEST(Verdict, IsUnexplainedWhereTheModelGivesUpAPartOfThePath) {
  const data::Fit fit = fit_of(track_of(pushed(2.4), white(kUsualSigma_m, 10)), top());
  EXPECT_EQ(fit.verdict, data::FitVerdict::unexplained) << fit.verdict_words;
  EXPECT_THAT(fit.verdict_words, testing::HasSubstr("left out of the fit"));
}

TEST(Verdict, IsDoubtfulWhereTheModelGivesUpAFewPositionsOfThePath) {
  const data::Fit fit = fit_of(track_of(pushed(2.75), white(kUsualSigma_m, 10)), top());
  EXPECT_EQ(fit.verdict, data::FitVerdict::doubtful) << fit.verdict_words;
}

// What integrating leaves is no noise: of a simulated track nothing stands out.
TEST(Verdict, IsGoodForASimulatedTrackWithoutNoise) {
  data::Track track = track_of(nutating_top(), [] { return 0.0; });
  for (data::TrackSample& sample : track.samples) sample.covariance_m2.setConstant(NAN);
  std::set<int> many;
  for (int i = 0; i < kUsualSamples; i += 4) many.insert(i);
  EXPECT_EQ(verdict_at(track, kNutating, false, many), data::FitVerdict::good);
}

// Of a short track one or two are soon a tenth.
TEST(Verdict, StandsWhereOneOrTwoPositionsAreGivenUp) {
  data::Track track = track_of(nutating_top(), white(kUsualSigma_m, 12));
  std::vector<data::TrackSample> few;
  for (std::size_t i = 0; i < track.samples.size(); i += 10) few.push_back(track.samples[i]);
  track.samples = few;
  EXPECT_EQ(verdict_at(track, kNutating, false, {4, 11}), data::FitVerdict::good);
  EXPECT_EQ(verdict_at(track, kNutating, false, {4, 5, 11}), data::FitVerdict::unexplained);
}

// Samples [from, to) that stand out, and what is said of that.
data::Fit with_samples_off(int from, int to) {
  std::set<int> off;
  for (int i = from; i < to; ++i) off.insert(i);
  const data::Track track = track_of(nutating_top(), white(kUsualSigma_m, 12));
  return fit_at(track, kNutating, false, off, kStandsOut);
}

// What a body does there that the model does not let it costs little, as it is given up.
TEST(Verdict, IsDoubtfulWhereTheModelMissesWhereTheRecordBeginsOrEnds) {
  const data::Fit first = with_samples_off(0, 12);
  EXPECT_EQ(first.verdict, data::FitVerdict::doubtful);
  EXPECT_THAT(first.verdict_words, testing::HasSubstr("12 of the 12 first positions"));
  EXPECT_THAT(first.verdict_words, testing::HasSubstr("the state given for 0 s"));
  const data::Fit last = with_samples_off(kUsualSamples - 12, kUsualSamples);
  EXPECT_EQ(last.verdict, data::FitVerdict::doubtful);
  EXPECT_THAT(last.verdict_words, testing::HasSubstr("12 of the 12 last positions"));
  EXPECT_EQ(with_samples_off(90, 102).verdict, data::FitVerdict::good);
}

// Those that noise hides do not make the others the tracker's.
TEST(Verdict, IsDoubtfulWhereHalfOfTheFirstPositionsAreMissed) {
  std::set<int> every_other;
  for (int i = 0; i < 20; i += 2) every_other.insert(i);
  const data::Track track = track_of(nutating_top(), white(kUsualSigma_m, 12));
  EXPECT_EQ(fit_at(track, kNutating, false, every_other, kStandsOut).verdict,
            data::FitVerdict::doubtful);
}

TEST(Verdict, StandsAndIsRemarkedOnWhereATrackerMayHaveMissedTheFirstFewPositions) {
  const data::Fit few = with_samples_off(0, 4), fewer = with_samples_off(0, 2);
  EXPECT_EQ(few.verdict, data::FitVerdict::good);
  EXPECT_THAT(few.warnings, testing::Contains(testing::HasSubstr("as if the tracker had erred")));
  EXPECT_EQ(fewer.verdict, data::FitVerdict::good);
  EXPECT_THAT(fewer.warnings, testing::IsEmpty());
}

// A run of them beside the path of the others is most often the tracker's, but not always.
TEST(Verdict, IsRemarkedOnWhereTheFirstPositionsLieOnNoPathWithTheOthers) {
  data::Track track = track_of(nutating_top(), white(kUsualSigma_m, 12));
  for (std::size_t i = 0; i < 6; ++i)
    track.samples[i].centre_m += Eigen::Vector2d(i % 2 == 0 ? 0.03 : -0.02, 0.01);
  const data::Fit fit = fit_of(track, top());
  EXPECT_EQ(fit.verdict, data::FitVerdict::good) << fit.verdict_words;
  EXPECT_THAT(fit.warnings,
              testing::Contains(testing::AllOf(testing::HasSubstr("6 of the 6 first positions"),
                                               testing::HasSubstr("as if the tracker had erred"))));
}

// Glitches anywhere in the picture are the tracker's, however many.
TEST(Verdict, IsGoodWhereTheTrackerTookOtherThingsForTheBody) {
  data::Track track = track_of(nutating_top(), white(kUsualSigma_m, 11));
  for (std::size_t i = 5; i < track.samples.size(); i += 8)
    track.samples[i].centre_m = Eigen::Vector2d(0.3, -0.2 + 0.002 * static_cast<double>(i % 7));
  const data::Fit fit = fit_of(track, top());
  EXPECT_EQ(fit.verdict, data::FitVerdict::good) << fit.verdict_words;
}

// A top that nutates once in 2.3 frames, fitted in the wrong phase. A smooth curve knows nothing of
// nutations as fast as that: samples scatter about it as much as they are off the prediction.
TEST(Verdict, DoesNotTakeMotionBetweenTooFewFramesForNoise) {
  const std::map<std::string, double> fast{
      {"a_1_s2", 2000.0}, {"b_1_s", 164.0}, {"l_m", 0.1}, {"theta_rad", 0.8}};
  const data::Track track = track_of(nutating_top(fast), white(kUsualSigma_m, 9));
  const auto verdict = [&](const std::map<std::string, double>& found) {
    return verdict_at(track, found, false);
  };
  EXPECT_EQ(verdict(fast), data::FitVerdict::good);
  std::map<std::string, double> shifted = fast;
  shifted["dtheta_rad_s"] = 8.0, shifted["dphi_rad_s"] = 12.0;
  EXPECT_EQ(verdict(shifted), data::FitVerdict::unexplained);
}

// So many of a top's frames, a few to a nutation.
data::Track seen_seldom(const std::map<std::string, double>& motion, int samples, int every,
                        double noise_m, std::uint64_t seed) {
  const int all = every * (samples - 1) + 1;
  data::Track track = track_of(nutating_top(motion, top(), all), white(noise_m, seed), all);
  std::vector<data::TrackSample> few;
  for (int i = 0; i < all; i += every) few.push_back(track.samples[static_cast<std::size_t>(i)]);
  track.samples = few;
  return track;
}

// The same of a record of few frames, whose scatter about a smooth curve is motion for the most
// part. Residuals were held against that: of 22 times the stated noise it was said that they look
// like noise.
TEST(Verdict, DoesNotTakeMotionBetweenAFewFramesForNoise) {
  const std::map<std::string, double> slow{
      {"a_1_s2", 0.098}, {"b_1_s", 0.75}, {"l_m", 0.1}, {"theta_rad", M_PI / 3}};
  constexpr double kNoNoise = 4.0;  // times the stated
  for (const int samples : {12, 14, 16, 18}) {
    const int every = 1800 / (samples - 1);
    const data::Fit fit = fit_of(seen_seldom(slow, samples, every, kUsualSigma_m, 16), top());
    EXPECT_TRUE(!says_explained(fit) || fit.noise_scale < kNoNoise) << fit.verdict_words;
  }
}

// Trackers misjudge their noise.
TEST(Verdict, IsNoWorseForAFewFramesOfTwiceTheStatedNoise) {
  for (const int samples : {12, 15, 18})
    for (const std::uint64_t seed : {17U, 18U, 19U, 20U}) {
      const data::Track track = seen_seldom(kNutating, samples, 9, 2.0 * kUsualSigma_m, seed);
      const data::Fit fit = fit_of(track, top());
      EXPECT_TRUE(says_explained(fit)) << fit.verdict_words;
    }
}

TEST(Verdict, FindsNothingOfATopInAStraightLine) {
  const auto line = [](double t) { return Eigen::Vector2d(0.05 * t, 0.01 - 0.02 * t); };
  const data::Fit fit = fit_of(track_of(line, white(kUsualSigma_m, 3)), top());
  EXPECT_FALSE(fit.converged);
  EXPECT_EQ(fit.outcome, data::FitOutcome::not_identifiable);
  EXPECT_EQ(fit.verdict, data::FitVerdict::no_feature);
  EXPECT_THAT(fit.verdict_words, testing::HasSubstr("a straight line in time"));
}

// Without a trace of noise, and so of what its size could be compared with.
TEST(Verdict, FindsNothingInABodyThatStandsStill) {
  data::Track track;
  for (int i = 0; i < kUsualSamples; ++i) {
    data::TrackSample sample;
    sample.t_s = i / kRate_Hz;
    sample.centre_m = Eigen::Vector2d(0.1, 0.2);
    track.samples.push_back(sample);
  }
  const data::Fit fit = fit_of(track, rolling_disc());
  EXPECT_FALSE(fit.converged);
  EXPECT_EQ(fit.verdict, data::FitVerdict::no_feature) << fit.verdict_words;
}

TEST(Verdict, FindsNothingInWhiteNoise) {
  const auto nowhere = [](double) { return Eigen::Vector2d(0.0, 0.0); };
  const data::Track track = track_of(nowhere, white(kUsualSigma_m, 4));
  for (const data::Scene& scene : {top(), rolling_disc()}) {
    const data::Fit fit = fit_of(track, scene);
    EXPECT_FALSE(fit.converged) << fit.model;
    EXPECT_NE(fit.outcome, data::FitOutcome::converged) << fit.model;
  }
}

TEST(Verdict, DoesNotTakeAFigureOfAnotherOriginForAMotionItKnows) {
  const auto figure = [](double t) {
    return Eigen::Vector2d(0.03 * std::cos(2.0 * t) + 0.01 * std::cos(5.0 * t + 1.0),
                           0.02 * std::sin(3.0 * t));
  };
  const data::Track track = track_of(figure, white(kUsualSigma_m, 5));
  for (const data::Scene& scene : {top(), rolling_disc()}) {
    const data::Fit fit = fit_of(track, scene);
    EXPECT_FALSE(fit.converged) << fit.model;
    EXPECT_EQ(fit.verdict, data::FitVerdict::unexplained) << fit.model;
  }
}

TEST(Verdict, IsWeakWhereParametersAreNotDetermined) {
  const auto circle = [](double t) {
    return Eigen::Vector2d(0.03 * std::cos(2.0 * t), 0.03 * std::sin(2.0 * t));
  };
  const data::Fit fit = fit_of(track_of(circle, white(kUsualSigma_m, 6)), top());
  EXPECT_EQ(fit.verdict, data::FitVerdict::weak) << fit.verdict_words;
  EXPECT_THAT(fit.verdict_words, testing::HasSubstr("not determined: a_1_s2"));
}

}  // namespace
}  // namespace trochoid::fitting
