#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <map>
#include <random>
#include <string>

#include "common.hpp"
#include "reference_motion.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/fitting/fit.hpp"
#include "trochoid/model/predictor.hpp"
#include "values_with.hpp"

namespace trochoid::fitting {
namespace {

// The thesis' base case at 250 times, without noise.
Eigen::VectorXd thesis_motion(double duration_s, const std::vector<model::Observable>& seen) {
  data::Scene scene;
  scene.model.name = "top";
  const auto predictor = model::make_predictor(scene);
  const Eigen::VectorXd values = values_with(*predictor, {{"a_1_s2", 0.098},
                                                          {"b_1_s", 0.75},
                                                          {"l_m", 0.1},
                                                          {"theta_rad", M_PI / 3.0},
                                                          {"omega_s_rad_s", 3.0}});
  std::vector<double> t_s;
  for (int i = 0; i < 250; ++i) t_s.push_back(duration_s * i / 249.0);
  model::PredictRequest request;
  request.t_s = t_s;
  request.observables = seen;
  return predictor->predict(values, request).values;
}

// 10 s, a little more than one nutation, unless told otherwise.
data::Track thesis_track(double duration_s, double sigma_m, std::uint64_t seed) {
  using model::Observable;
  const Eigen::VectorXd exact = thesis_motion(duration_s, {Observable::x_m, Observable::y_m});
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal(0.0, sigma_m);
  data::Track track;
  for (int i = 0; i < 250; ++i) {
    data::TrackSample sample;
    sample.t_s = duration_s * i / 249.0;
    sample.centre_m = exact.segment<2>(2 * i);
    sample.centre_m.x() += normal(generator);
    sample.centre_m.y() += normal(generator);
    sample.covariance_m2 = Eigen::Matrix2d::Identity() * sigma_m * sigma_m;
    track.samples.push_back(sample);
  }
  return track;
}

data::Fit fit_top(const data::Track& track, FitOptions options) {
  data::Scene scene;
  scene.model.name = "top";
  return fit(std::span(&track, 1), scene, options);
}

// The same as if it had been measured in pictures.
data::Track filmed(data::Track track) {
  for (data::TrackSample& sample : track.samples) sample.centre_px = {0.0, 0.0};
  return track;
}

const data::Profile& profile_of(const data::Fit& result, const std::string& name) {
  for (const data::Profile& profile : result.profiles)
    if (profile.parameter == name) return profile;
  throw std::runtime_error("no profile of " + name);
}

TEST(ProfileLikelihood, AgreesWithTheCovarianceWhereTheModelIsNearlyLinear) {
  FitOptions options;
  options.profile = true;
  const data::Fit result = fit_top(thesis_track(25.0, 2e-4, 1), options);
  ASSERT_TRUE(result.converged) << result.reason;
  for (const char* name : {"a_1_s2", "b_1_s", "l_m"}) {
    const data::Profile& profile = profile_of(result, name);
    const data::FitParameter& parameter = *result.find(name);
    EXPECT_EQ(profile.verdict, data::ProfileVerdict::bounded);
    // 0.2 % noise over 2.5 nutations: curvature changes the interval by a few per cent.
    const double half = 1.96 * parameter.sigma;
    EXPECT_NEAR(profile.upper_95 - parameter.value, half, 0.1 * half) << name;
    EXPECT_NEAR(parameter.value - profile.lower_95, half, 0.1 * half) << name;
    EXPECT_TRUE(std::is_sorted(profile.values.begin(), profile.values.end()));
    EXPECT_EQ(profile.values.size(), profile.delta_chi2.size());
  }
}

// A bound half an error bar above where it would come out: the profile ends there.
TEST(ProfileLikelihood, OfWhatIsBoundedFromAboveReachesFromItsLowerLimitToTheBound) {
  FitOptions options;
  const data::Track track = thesis_track(25.0, 2e-4, 1);
  const data::FitParameter plain = *fit_top(track, options).find("b_1_s");
  const double bound_1_s = plain.value + 0.5 * plain.sigma;
  data::Scene scene;
  scene.model.name = "top";
  scene.fit.bounds["b_1_s"] = {-std::numeric_limits<double>::infinity(), bound_1_s};
  options.profile = true;
  const data::Fit result = fit(std::span(&track, 1), scene, options);
  ASSERT_TRUE(result.converged) << result.reason;
  const data::Profile& profile = profile_of(result, "b_1_s");
  EXPECT_EQ(profile.verdict, data::ProfileVerdict::one_sided);
  EXPECT_NEAR(profile.lower_95, plain.value - 1.96 * plain.sigma, 0.2 * plain.sigma);
  EXPECT_EQ(profile.upper_95, bound_1_s);
}

TEST(ProfileLikelihood, IsNotBoundedOnBothSidesByAFractionOfANutation) {
  FitOptions options;
  options.profile = true;
  const data::Fit result = fit_top(thesis_track(2.0, 1e-3, 2), options);
  // A fifth of a nutation does not tell an infinite length from a long one.
  EXPECT_THAT(profile_of(result, "l_m").verdict,
              testing::AnyOf(data::ProfileVerdict::one_sided, data::ProfileVerdict::flat));
}

// Secant steps that ended too soon, from where the other parameters were lost, gave a "95 %" bound
// where chi-square had risen by 0.5.
TEST(ProfileLikelihood, OfALossThatIsNotThereIsBoundedWhereChiSquareHasRisenByIt) {
  FitOptions options;
  options.profile = true;
  options.bootstrap = 3;
  data::Scene scene;
  scene.model.name = "top";
  scene.body.emplace().kind = data::BodyKind::top;
  scene.model.drag_spin_N_m_s = 1e-3;
  for (const std::uint64_t seed : {1, 2, 3}) {
    const data::Track track = thesis_track(25.0, 5e-4, seed);
    const data::Fit result = fit(std::span(&track, 1), scene, options);
    const data::Profile& drag = profile_of(result, "gamma3_1_s");
    const auto upper = std::find(drag.values.begin(), drag.values.end(), drag.upper_95);
    ASSERT_NE(upper, drag.values.end());
    constexpr double kQuantile95 = 3.8415;  // of a chi-square, one degree of freedom
    EXPECT_NEAR(drag.delta_chi2[static_cast<std::size_t>(upper - drag.values.begin())], kQuantile95,
                0.05 * kQuantile95);
  }
}

// The walk began at the millionth of the first value where such a loss is held, and ended long
// before it did anything: "flat, 95 % 0 .. inf" beside an error bar of 1.8e-6 m.
TEST(ProfileLikelihood, OfALossThatIsHeldAtNothingReachesToItsErrorBar) {
  NoisyMotion motion = noisy("s06_roll_disc", 1.0, 1e-4, 4);
  motion.scene.model.contour_friction_m = 1e-5;
  FitOptions options;
  options.profile = true;
  int held = 0;
  for (const unsigned seed : {1U, 2U, 3U, 4U}) {
    motion.track = noisy("s06_roll_disc", 1.0, 1e-4, 4, seed).track;
    const data::Fit result = fit(std::span(&motion.track, 1), motion.scene, options);
    const data::FitParameter& loss = *result.find("contour_friction_m");
    if (loss.note.find("not seen: between 0 and") == std::string::npos) continue;
    ++held;
    const data::Profile& profile = profile_of(result, "contour_friction_m");
    EXPECT_EQ(profile.verdict, data::ProfileVerdict::one_sided);
    EXPECT_EQ(profile.lower_95, 0.0);
    EXPECT_GT(profile.upper_95, 0.3 * loss.sigma);
    EXPECT_LT(profile.upper_95, 3.0 * loss.sigma);
  }
  EXPECT_GT(held, 0);
}

TEST(Bootstrap, AgreesWithTheCovarianceOfWhiteNoiseAndRepeatsItself) {
  FitOptions options;
  options.bootstrap = 200;
  options.seed = 7;
  options.threads = 1;
  const data::Track track = thesis_track(25.0, 1e-3, 3);
  const data::Fit one = fit_top(track, options);
  ASSERT_EQ(one.bootstrap.draws, 200);
  EXPECT_EQ(one.bootstrap.failed, 0);
  ASSERT_EQ(one.bootstrap.parameters.size(), 7U);
  for (const data::BootstrapSpread& spread : one.bootstrap.parameters) {
    // The sd of 200 draws scatters by 5 %; 4 of these, and as much for short blocks.
    const double sigma = one.find(spread.parameter)->sigma;
    EXPECT_NEAR(spread.sigma / sigma, 1.0, 0.3) << spread.parameter;
    EXPECT_LT(spread.lower_95, one.find(spread.parameter)->value);
    EXPECT_GT(spread.upper_95, one.find(spread.parameter)->value);
  }
  options.threads = 2;
  const data::Fit two = fit_top(track, options);
  for (std::size_t i = 0; i < one.bootstrap.parameters.size(); ++i)
    EXPECT_EQ(one.bootstrap.parameters[i].sigma, two.bootstrap.parameters[i].sigma);
}

// Light and shadow put a filmed body aside in every picture alike, by half of what it scatters by,
// though residuals be white.
TEST(FilmedTracks, MayBeOffAltogetherByHalfOfTheirScatter) {
  constexpr double kSigma_m = 1e-3;
  const data::Track plain = thesis_track(25.0, kSigma_m, 4);
  FitOptions options;
  options.free_pivot = true;
  const data::Fit apart = fit_top(plain, options), common = fit_top(filmed(plain), options);
  for (const char* name : {"pivot_x_m", "pivot_y_m"}) {
    const double offset_m =
        std::sqrt(std::pow(common.find(name)->sigma, 2) - std::pow(apart.find(name)->sigma, 2));
    EXPECT_NEAR(offset_m, 0.5 * common.noise_scale * kSigma_m, 1e-3 * kSigma_m) << name;
  }
}

// A lamp shifts it to the side its face looks to, wherever that is: then the top seems longer.
TEST(FilmedTracks, MayBeOffTowardsTheSideTheirFaceLooksTo) {
  constexpr double kSigma_m = 1e-3, kTilt_rad = M_PI / 3.0;
  data::Track plain = thesis_track(25.0, kSigma_m, 4), seen = plain;
  for (data::TrackSample& sample : seen.samples)
    sample.phi = {std::atan2(sample.centre_m.x(), -sample.centre_m.y()), 0.02};
  const auto offset_m = [](const data::Track& track) {
    const data::Fit apart = fit_top(track, {}), common = fit_top(filmed(track), {});
    return std::sqrt(std::pow(common.find("l_m")->sigma, 2) -
                     std::pow(apart.find("l_m")->sigma, 2));
  };
  const double longer_m = 0.5 * kSigma_m / std::sin(kTilt_rad);
  EXPECT_NEAR(offset_m(seen), longer_m, 0.2 * longer_m);
  EXPECT_LT(offset_m(plain), 0.6 * longer_m);  // where that is not seen
}

// A mark on it may be read aside as well; where it scatters by much less than is stated, by a
// quarter of that.
TEST(FilmedTracks, MayHaveTheirSpinOffAltogether) {
  constexpr double kDuration_s = 25.0, kScatter_rad = 0.02;
  const Eigen::VectorXd psi_rad = thesis_motion(kDuration_s, {model::Observable::psi_rad});
  const auto offset_rad = [&](double stated_rad) {
    data::Track track = thesis_track(kDuration_s, 1e-3, 4);
    std::mt19937_64 generator(5);
    std::normal_distribution<double> normal(0.0, kScatter_rad);
    for (Eigen::Index i = 0; i < psi_rad.size(); ++i)
      track.samples[i].psi = {psi_rad[i] + normal(generator), stated_rad};
    const data::Fit apart = fit_top(track, {}), common = fit_top(filmed(track), {});
    return std::sqrt(std::pow(common.find("psi_rad")->sigma, 2) -
                     std::pow(apart.find("psi_rad")->sigma, 2));
  };
  // How much 250 samples scatter is known to 4.5 %.
  EXPECT_NEAR(offset_rad(kScatter_rad), 0.5 * kScatter_rad, 0.1 * kScatter_rad);
  EXPECT_NEAR(offset_rad(10.0 * kScatter_rad), 2.5 * kScatter_rad, 0.1 * kScatter_rad);
}

// One body, three throws: a and l are shared, the spin and the start are each recording's own.
TEST(SeveralRecordings, ShareTheBodyAndKeepTheirStarts) {
  const std::vector<data::Track> tracks{thesis_track(25.0, 1e-3, 11), thesis_track(25.0, 1e-3, 12),
                                        thesis_track(25.0, 1e-3, 13)};
  data::Scene scene;
  scene.model.name = "top";
  FitOptions options;
  options.threads = 1;
  const data::Fit alone = fit(std::span(tracks).first(1), scene, options);
  const data::Fit all = fit(tracks, scene, options);
  ASSERT_TRUE(all.converged) << all.reason;
  ASSERT_EQ(all.arcs.size(), 3U);
  EXPECT_NE(all.find("theta_rad@2"), nullptr);
  EXPECT_EQ(all.find("l_m@1"), nullptr);
  const data::FitParameter& l = *all.find("l_m");
  EXPECT_LT(std::abs(l.value - 0.1), 4.0 * l.sigma);
  // Three equal recordings: 1/sqrt(3) = 0.58; the estimated noise adds a few per cent.
  EXPECT_NEAR(l.sigma / alone.find("l_m")->sigma, 0.58, 0.08);
  options.threads = 3;
  EXPECT_EQ(fit(tracks, scene, options).find("l_m")->value, l.value);
}

// From what each of them says of the body all had been fitted together: of 60 recordings 60 times.
TEST(SeveralRecordings, AreFittedTogetherFromAFewOfThemWhereTheseAgree) {
  constexpr int kTracks = 7, kRows = 2 * 250;
  std::vector<data::Track> tracks;
  for (std::uint64_t seed = 1; seed <= kTracks; ++seed)
    tracks.push_back(thesis_track(25.0, 1e-3, seed));
  FitOptions options;
  options.threads = 1;
  bool searching = true;
  int together = 0;
  options.log = [&](const std::string& line) {
    searching = searching && line != "weighing the samples";
    together += searching && std::atoi(line.c_str()) > (kTracks - 1) * kRows ? 1 : 0;
  };
  const data::Fit result = fit(tracks, top(), options);
  EXPECT_EQ(result.verdict, data::FitVerdict::good) << result.verdict_words;
  EXPECT_GT(together, 0);
  EXPECT_LT(together, kTracks);
}

// Eight samples to a nutation: the path bends far more between them than they scatter, which no
// first guess of the noise tells.
TEST(SeveralRecordings, WithoutCovariancesHaveEachItsOwnNoise) {
  constexpr double kDuration_s = 250.0;
  const std::array kNoise_m{2e-5, 2e-4};
  std::vector<data::Track> tracks;
  for (std::size_t i = 0; i < kNoise_m.size(); ++i) {
    tracks.push_back(thesis_track(kDuration_s, kNoise_m[i], 11 + i));
    for (data::TrackSample& sample : tracks.back().samples)
      sample.covariance_m2.setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  data::Scene scene;
  scene.model.name = "top";
  const data::Fit both = fit(tracks, scene);
  EXPECT_EQ(both.verdict, data::FitVerdict::good) << both.verdict_words;
  EXPECT_LT(pull(both, "l_m", 0.1), kFar);
  EXPECT_LT(pull(both, "theta_rad", M_PI / 3.0), kFar);
  EXPECT_LT(pull(both, "theta_rad@1", M_PI / 3.0), kFar);
  const double times = both.find("phi_rad@1")->sigma / both.find("phi_rad")->sigma;
  EXPECT_NEAR(times, kNoise_m[1] / kNoise_m[0], 2.0);
  EXPECT_THAT(both.warnings,
              testing::Contains(testing::HasSubstr("track 1 has no covariances: the "
                                                   "noise of its positions, 2e-05 m")));
}

// What one states of its noise was taken for both: 241 of 962 positions "far off".
TEST(SeveralRecordings, HaveEachItsOwnNoiseWhateverTheyState) {
  constexpr double kOverstated = 10.0;
  std::vector<data::Track> tracks{thesis_track(25.0, 1e-3, 11), thesis_track(25.0, 1e-3, 12)};
  data::Scene scene;
  scene.model.name = "top";
  const data::Fit honest = fit(tracks, scene);
  for (data::TrackSample& sample : tracks[1].samples)
    sample.covariance_m2 *= kOverstated * kOverstated;
  const data::Fit both = fit(tracks, scene);
  EXPECT_EQ(both.verdict, data::FitVerdict::good) << both.verdict_words;
  EXPECT_THAT(both.verdict_words, testing::HasSubstr(" to 0.99 times the stated"));
  EXPECT_NEAR(both.arcs[1].noise_scale * kOverstated, honest.arcs[1].noise_scale, 0.1);
  EXPECT_NEAR(both.find("l_m")->sigma, honest.find("l_m")->sigma, 0.05 * honest.find("l_m")->sigma);
  EXPECT_LT(pull(both, "l_m", 0.1), kFar);
}

// Four in five samples that state ten times too much pulled the noise of all below a tenth of what
// the fifth state rightly, and the fit, which leans on these, was too sure by more than five times.
TEST(OverstatedNoise, OfManySamplesDoesNotMakeTheOthersErrorBarsSmall) {
  constexpr double kNoise_m = 1e-3, kOverstated = 10.0;
  const data::Track honest = thesis_track(25.0, kNoise_m, 11);
  data::Scene scene;
  scene.model.name = "top";
  const data::Fit full = fit(std::span(&honest, 1), scene);
  data::Track along = honest, everywhere = honest;
  for (std::size_t i = 0; i < honest.samples.size(); ++i) {
    if (i % 5 == 0) continue;
    along.samples[i].covariance_m2(0, 0) *= kOverstated * kOverstated;
    everywhere.samples[i].covariance_m2 *= kOverstated * kOverstated;
  }
  // The scale is known from some fifty samples: 7 %, of which 20 % is three times as much.
  const data::Fit fifth = fit(std::span(&everywhere, 1), scene);
  EXPECT_NEAR(fifth.noise_scale, 1.0, 0.2);
  EXPECT_GT(fifth.find("l_m")->sigma, 1.7 * full.find("l_m")->sigma);
  EXPECT_LT(pull(fifth, "l_m", 0.1), kFar);
  // Of every sample at least one coordinate is known as stated.
  const data::Fit across = fit(std::span(&along, 1), scene);
  EXPECT_NEAR(across.noise_scale, 1.0, 0.15);
  EXPECT_LT(pull(across, "l_m", 0.1), kFar);
}

TEST(SeveralRecordings, ThatDoNotShareWhatTheyShouldAreDoubtfulAndToldApart) {
  std::vector<data::Track> tracks{thesis_track(25.0, 1e-3, 11), thesis_track(25.0, 1e-3, 12),
                                  thesis_track(25.0, 1e-3, 13)};
  for (data::TrackSample& sample : tracks[2].samples) sample.centre_m *= 1.02;
  data::Scene scene;
  scene.model.name = "top";
  const data::Fit all = fit(tracks, scene);
  EXPECT_EQ(all.verdict, data::FitVerdict::doubtful) << all.verdict_words;
  EXPECT_THAT(all.verdict_words, testing::HasSubstr("above all track 3: for l_m = 0.10"));
}

// A tenth more of one length: no common one follows either, and the residuals were all that was
// told; by derivatives from there the tracks asked for what neither has.
TEST(SeveralRecordings, ThatAreExplainedByThemselvesAloneAreToldWhatEachSays) {
  std::vector<data::Track> tracks{thesis_track(25.0, 1e-3, 11), thesis_track(25.0, 1e-3, 12)};
  for (data::TrackSample& sample : tracks[1].samples) sample.centre_m *= 1.1;
  data::Scene scene;
  scene.model.name = "top";
  const data::Fit both = fit(tracks, scene);
  EXPECT_FALSE(both.verdict == data::FitVerdict::good) << both.verdict_words;
  EXPECT_THAT(both.verdict_words, testing::HasSubstr("explains each of the tracks by itself"));
  EXPECT_THAT(both.verdict_words, testing::ContainsRegex("l_m = 0.0.* .track 1., 0.1.* .track 2."));
  EXPECT_THAT(both.warnings, testing::Not(testing::Contains(testing::HasSubstr("rather than"))));
}

// The second one's pivot is pushed along.
TEST(SeveralRecordings, OfWhichOneIsNotExplainedByItselfAreToldWhich) {
  std::vector<data::Track> tracks{thesis_track(25.0, 1e-3, 11), thesis_track(25.0, 1e-3, 12)};
  for (data::TrackSample& sample : tracks[1].samples) sample.centre_m.x() += 0.01 * sample.t_s;
  data::Scene scene;
  scene.model.name = "top";
  EXPECT_THAT(fit(tracks, scene).verdict_words,
              testing::HasSubstr("by itself the model explains track 1, but not 2"));
}

// Another thing was tracked: with 150 times its stated noise it had been "explained".
TEST(SeveralRecordings, OfWhichOneShowsNothingOfTheBodyAreNotExplained) {
  constexpr double kOff_m = 0.03;
  data::Scene scene;
  scene.model.name = "top";
  for (const unsigned seed : {5U, 6U, 7U}) {
    std::vector<data::Track> tracks{thesis_track(25.0, 1e-3, 11), thesis_track(25.0, 1e-3, 12),
                                    thesis_track(25.0, 1e-3, 13)};
    std::mt19937 generator(seed);
    std::normal_distribution<double> normal(0.0, kOff_m);
    for (data::TrackSample& sample : tracks[1].samples)
      sample.centre_m = {normal(generator), normal(generator)};
    const data::Fit found = fit(tracks, scene);
    EXPECT_TRUE(found.verdict == data::FitVerdict::doubtful ||
                found.verdict == data::FitVerdict::unexplained)
        << found.verdict_words;
    // Whether a path that is none ends in a minimum is chance, and so are the words.
    EXPECT_THAT(found.verdict_words,
                testing::AnyOf(testing::HasSubstr("explains the path of track 2 as well"),
                               testing::HasSubstr("nothing asks for it in track 2")));
  }
}

// Their times alone do not tell, all begin at 0.
TEST(SeveralRecordings, AreNamedWherePositionsOfOneAreGivenUp) {
  std::vector<data::Track> tracks{thesis_track(25.0, 1e-3, 11), thesis_track(25.0, 1e-3, 12),
                                  thesis_track(25.0, 1e-3, 13)};
  for (data::TrackSample& sample : tracks[1].samples)
    if (sample.t_s > 23.0) sample.centre_m.x() += 0.02;
  data::Scene scene;
  scene.model.name = "top";
  EXPECT_THAT(
      fit(tracks, scene).warnings,
      testing::Contains(testing::HasSubstr("hardly count, the first, of track 2, at t = 23")));
}

// What they share the long one tells, whichever comes first.
TEST(SeveralRecordings, AreShortWhereAllOfThemAre) {
  const data::Track brief = thesis_track(7.0, 1e-3, 12), whole = thesis_track(25.0, 1e-3, 11);
  data::Scene scene;
  scene.model.name = "top";
  const auto warnings_of = [&](const data::Track& first, const data::Track& second) {
    const std::vector<data::Track> tracks{first, second};
    return fit(tracks, scene).warnings;
  };
  const auto warned = testing::Contains(testing::HasSubstr("nutation periods long"));
  EXPECT_THAT(warnings_of(brief, whole), testing::Not(warned));
  EXPECT_THAT(warnings_of(whole, brief), testing::Not(warned));
  EXPECT_THAT(warnings_of(brief, thesis_track(7.0, 1e-3, 13)),
              testing::Contains(testing::HasSubstr("the longest of the tracks is about 0.")));
}

TEST(Prior, ThatContradictsTheTrackMakesTheFitDoubtful) {
  const data::Track track = thesis_track(25.0, 1e-3, 11);
  data::Scene scene;
  scene.model.name = "top";
  const double alone = fit_of(track, scene).find("l_m")->value;
  scene.fit.prior["l_m"] = {alone + 5e-4, 5e-4};
  const data::Fit agreed = fit_of(track, scene);
  EXPECT_EQ(agreed.verdict, data::FitVerdict::good) << agreed.verdict_words;
  EXPECT_THAT(agreed.warnings, testing::Not(testing::Contains(testing::HasSubstr("prior"))));

  scene.fit.prior["l_m"] = {alone + 5e-3, 5e-4};
  const data::Fit torn = fit_of(track, scene);
  EXPECT_EQ(torn.verdict, data::FitVerdict::doubtful) << torn.verdict_words;
  EXPECT_THAT(torn.verdict_words, testing::HasSubstr("the prior l_m = 0.1046"));
  EXPECT_THAT(torn.verdict_words, testing::HasSubstr("which alone says about 0.0996"));
}

TEST(Prior, OnAnAngleIsAsNearByWholeTurns) {
  const data::Track track = thesis_track(25.0, 1e-3, 11);
  data::Scene scene;
  scene.model.name = "top";
  const double alone = fit_of(track, scene).find("phi_rad")->value;
  scene.fit.prior["phi_rad"] = {alone + 2.0 * M_PI + 0.05, 0.1};
  const data::Fit result = fit_of(track, scene);
  EXPECT_EQ(result.verdict, data::FitVerdict::good) << result.verdict_words;
  EXPECT_NEAR(result.find("phi_rad")->value, alone, 0.01);
  EXPECT_THAT(result.warnings, testing::Not(testing::Contains(testing::HasSubstr("prior"))));
}

// Left where it was, with the prior idle; named under free it was not looked for as by free_pivot.
TEST(Pivot, ThatIsKnownToAnErrorOnlyIsFitted) {
  data::Track track = thesis_track(25.0, 1e-3, 11);
  const Eigen::Vector2d off_m{0.03, -0.02};
  for (data::TrackSample& sample : track.samples) sample.centre_m += off_m;
  data::Scene by_prior, by_name;
  by_prior.model.name = by_name.model.name = "top";
  by_prior.fit.prior = {{"pivot_x_m", {0.0, 0.03}}, {"pivot_y_m", {0.0, 0.03}}};
  by_name.fit.free = {"pivot_x_m", "pivot_y_m"};
  for (const data::Scene& scene : {by_prior, by_name}) {
    const data::Fit found = fit_of(track, scene);
    EXPECT_EQ(found.verdict, data::FitVerdict::good) << found.verdict_words;
    EXPECT_LT(pull(found, "pivot_x_m", off_m.x()), kFar);
    EXPECT_LT(pull(found, "l_m", 0.1), kFar);
  }
}

// A length fixed at a little too much was taken for true: a and b came out 30 error bars off,
// "good".
TEST(FixedValue, ThatContradictsTheTrackMakesTheFitDoubtful) {
  const data::Track track = thesis_track(25.0, 1e-3, 11);
  data::Scene scene;
  scene.model.name = "top";
  scene.fit.fixed["l_m"] = 0.1;
  const data::Fit agreed = fit_of(track, scene);
  EXPECT_EQ(agreed.verdict, data::FitVerdict::good) << agreed.verdict_words;
  EXPECT_THAT(agreed.warnings, testing::Not(testing::Contains(testing::HasSubstr("is fixed"))));

  scene.fit.fixed["l_m"] = 0.105;
  const data::Fit torn = fit_of(track, scene);
  EXPECT_EQ(torn.verdict, data::FitVerdict::doubtful) << torn.verdict_words;
  EXPECT_THAT(torn.verdict_words,
              testing::HasSubstr("l_m = 0.105 is fixed, and the track alone says"));
}

// At the bound a and b came out 6 and more error bars off, "good".
TEST(Bound, ThatContradictsTheTrackMakesTheFitDoubtful) {
  const data::Track track = thesis_track(25.0, 1e-3, 11);
  data::Scene scene;
  scene.model.name = "top";
  const data::FitParameter l = *fit_of(track, scene).find("l_m");
  scene.fit.bounds["l_m"] = {l.value + l.sigma, 1.0};
  const data::Fit agreed = fit_of(track, scene);
  EXPECT_EQ(agreed.verdict, data::FitVerdict::good) << agreed.verdict_words;

  scene.fit.bounds["l_m"] = {l.value + 8.0 * l.sigma, 1.0};
  const data::Fit torn = fit_of(track, scene);
  EXPECT_EQ(torn.verdict, data::FitVerdict::doubtful) << torn.verdict_words;
  EXPECT_THAT(torn.verdict_words, testing::HasSubstr("l_m is bounded to at least 0.1"));
  EXPECT_THAT(torn.verdict_words, testing::HasSubstr("and the track alone says 0.09"));
}

// "It stands at the lower bound, 0, that [fit] bounds give it: the track may say that it is less."
TEST(Bound, BeyondWhichNothingCanBeIsNotStoodAt) {
  const data::Track track = thesis_track(25.0, 5e-4, 1);
  data::Scene scene = top();
  scene.body.emplace().kind = data::BodyKind::top;
  scene.model.drag_spin_N_m_s = 1e-3;
  scene.fit.bounds["gamma3_1_s"] = {0.0, 1.0};
  EXPECT_THAT(fit_of(track, scene).warnings,
              testing::Not(testing::Contains(testing::HasSubstr("stands at"))));
}

// They agree with each other, not with the bound.
TEST(SeveralRecordings, ThatABoundHoldsBackDoNotDiffer) {
  const std::vector<data::Track> tracks{thesis_track(25.0, 1e-3, 11), thesis_track(25.0, 1e-3, 12)};
  data::Scene scene;
  scene.model.name = "top";
  const data::FitParameter l = *fit(tracks, scene).find("l_m");
  scene.fit.bounds["l_m"] = {l.value + 12.0 * l.sigma, 1.0};
  const data::Fit both = fit(tracks, scene);
  EXPECT_THAT(both.verdict_words, testing::HasSubstr("l_m is bounded to at least"));
  EXPECT_THAT(both.warnings, testing::Not(testing::Contains(testing::HasSubstr("tracks ask"))));
}

TEST(SeveralRecordings, AreNamedWhereOneIsTooShortOrComesTwice) {
  std::vector<data::Track> tracks{thesis_track(25.0, 1e-3, 11), thesis_track(25.0, 1e-3, 12)};
  data::Scene scene;
  scene.model.name = "top";
  const auto refusal = [&] {
    try {
      (void)fit(tracks, scene);
    } catch (const trochoid::InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  tracks[1].samples.resize(1);
  EXPECT_THAT(refusal(), testing::HasSubstr("track 2: its 2 numbers cannot determine"));
  tracks[1] = thesis_track(25.0, 1e-3, 12);
  tracks[1].samples.resize(4);
  EXPECT_THAT(fit(tracks, scene).reason, testing::HasSubstr("track 2: its 4 samples are too few"));
  tracks[1] = tracks[0];
  EXPECT_THAT(refusal(),
              testing::HasSubstr("track 2 is the same as track 1; a recording counts once"));
}

// The second was let go at another angle, which a prior for all of them would have denied.
TEST(SeveralRecordings, HavePriorsOfTheirOwn) {
  std::vector<data::Track> tracks{thesis_track(25.0, 1e-3, 11), thesis_track(25.0, 1e-3, 12)};
  data::Scene scene;
  scene.model.name = "top";
  const data::Fit plain = fit(tracks, scene);
  const data::FitParameter second = *plain.find("theta_rad@1");
  scene.fit.prior["theta_rad@1"] = {second.value, 0.1 * second.sigma};
  const data::Fit told = fit(tracks, scene);
  EXPECT_LT(told.find("theta_rad@1")->sigma, 0.11 * second.sigma);
  EXPECT_GT(told.find("theta_rad")->sigma, 0.3 * plain.find("theta_rad")->sigma);
  EXPECT_THAT(told.warnings, testing::Not(testing::Contains(testing::HasSubstr("[fit] prior"))));
  scene.fit.prior = {{"theta_rad@2", {second.value, 0.1}}};
  EXPECT_THAT(fit(tracks, scene).warnings,
              testing::Contains(testing::HasSubstr("'theta_rad@2', the prior counts for nothing")));
}

TEST(GivenUp, MeasurementsAreTold) {
  data::Track track = thesis_track(25.0, 1e-3, 11);
  for (const std::size_t i : {40U, 120U, 121U}) track.samples[i].centre_m.y() += 0.05;
  const data::Fit result = fit_top(track, {});
  ASSERT_TRUE(result.converged) << result.reason;
  EXPECT_THAT(result.warnings,
              testing::Contains(testing::HasSubstr("3 of 250 positions and angles lie")));
}

// A coin that rolls from the first of 40 pictures on. The first two are blurred: they show no node
// line and hardly a tilt, and the second is 0.6 mm off. A coin that stands upright and slides until
// the third picture passes through it, and is found when the fit begins there.
class BlurredFirstPictures : public testing::Test {
 protected:
  BlurredFirstPictures() {
    scene_.body = data::Body{};
    scene_.body->radius_m = 0.012;
    scene_.body->thickness_m = 0.0018;
    scene_.body->mass_kg = 0.0069;
    scene_.model.name = "sliding";
    scene_.model.friction = 0.3;
    scene_.model.slip_regularisation_m_s = 5e-4;
    scene_.fit.fixed = {{"friction", 0.3}, {"slip_regularisation_m_s", 5e-4}};
  }

  [[nodiscard]] data::Track track() const {
    const auto predictor = model::make_predictor(scene_);
    std::vector<double> t_s;
    for (int i = 0; i < 40; ++i) t_s.push_back(i / 60.0);
    model::PredictRequest request;
    request.t_s = t_s;
    request.observables = {model::Observable::x_m, model::Observable::y_m,
                           model::Observable::theta_rad, model::Observable::phi_rad};
    const model::Prediction exact = predictor->predict(values_with(*predictor, kTruth), request);
    std::mt19937_64 generator(3);
    std::normal_distribution<double> normal;
    data::Track track;
    for (int i = 0; i < 40; ++i) {
      Eigen::Vector4d at = exact.values.segment<4>(4 * i);
      for (const auto& [k, sigma] : {std::pair{0, kSigma_m}, {1, kSigma_m}, {2, 0.03}, {3, 0.015}})
        if (i >= 2) at[k] += sigma * normal(generator);
      data::TrackSample sample;
      sample.t_s = t_s[static_cast<std::size_t>(i)];
      sample.centre_m = at.head<2>();
      sample.covariance_m2 = Eigen::Matrix2d::Identity() * kSigma_m * kSigma_m;
      sample.theta = data::MeasuredAngle{at[2], i < 2 ? 0.4 : 0.03};
      if (i >= 2) sample.phi = data::MeasuredAngle{at[3], 0.015};
      track.samples.push_back(sample);
    }
    track.samples[0].covariance_m2 << 3.4e-7, -6.4e-7, -6.4e-7, 1.8e-6;
    track.samples[1].covariance_m2 << 2.7e-8, 2.0e-8, 2.0e-8, 8.6e-8;
    track.samples[1].centre_m += Eigen::Vector2d(0.44e-3, -0.44e-3);
    return track;
  }

  static constexpr double kSigma_m = 2e-4;
  const std::map<std::string, double> kTruth{
      {"theta_rad", 1.216}, {"phi_rad", 1.852},  {"w1_rad_s", -5.12},
      {"w2_rad_s", 57.18},  {"w3_rad_s", 4.78},  {"x_m", -0.00373},
      {"y_m", 0.00579},     {"vx_m_s", -0.0552}, {"vy_m_s", -0.0219}};
  const std::map<std::string, double> kSliding{
      {"theta_rad", 1.56}, {"phi_rad", 2.026},  {"w1_rad_s", -20.8},
      {"w2_rad_s", 56.1},  {"w3_rad_s", 5.74},  {"x_m", -0.00289},
      {"y_m", 0.00434},    {"vx_m_s", -0.0745}, {"vy_m_s", 0.0399}};
  data::Scene scene_;
};

TEST_F(BlurredFirstPictures, DoNotTellTheStartBetterThanTheOthersDoWithoutOneOfThem) {
  FitOptions options;
  options.strategy = Strategy::single;
  options.start = kSliding;
  const data::Track blurred = track();
  const data::Fit result = fit(std::span(&blurred, 1), scene_, options);
  ASSERT_TRUE(std::isfinite(result.chi2)) << result.reason;
  constexpr double kSigmas = 3.0;
  for (const auto& [name, truth] : kTruth) {
    const data::FitParameter* found = result.find(name);
    ASSERT_NE(found, nullptr) << name;
    EXPECT_NEAR(found->value, truth, kSigmas * found->sigma) << name;
  }
  EXPECT_THAT(result.warnings, testing::Contains(testing::HasSubstr("hang on the sample at t = ")));
}

// A steady precession, of closed form: its path is a circle of radius l sin(theta), whatever l.
data::Track circling_track(bool tilt_seen, int seed = 5) {
  constexpr double kLength_m = 0.05, kTilt_rad = 0.8, kRate_rad_s = 6.0;
  constexpr double kSigma_m = 1e-4, kSigma_rad = 0.01;
  std::mt19937_64 generator(static_cast<std::uint64_t>(seed));
  std::normal_distribution<double> normal;
  data::Track track;
  for (int i = 0; i < 200; ++i) {
    data::TrackSample sample;
    sample.t_s = 0.02 * i;
    const double phi_rad = kRate_rad_s * sample.t_s;
    sample.centre_m =
        kLength_m * std::sin(kTilt_rad) * Eigen::Vector2d(std::sin(phi_rad), -std::cos(phi_rad)) +
        kSigma_m * Eigen::Vector2d{normal(generator), normal(generator)};
    sample.covariance_m2 = Eigen::Matrix2d::Identity() * kSigma_m * kSigma_m;
    if (tilt_seen)
      sample.theta = data::MeasuredAngle{kTilt_rad + kSigma_rad * normal(generator), kSigma_rad};
    track.samples.push_back(sample);
  }
  return track;
}

TEST(BrokenDegeneracies, AreThoseOfLengthAndTiltOfACircleWhoseTiltIsSeen) {
  const data::Fit blind = fit_top(circling_track(false), {});
  EXPECT_THAT(blind.broken_degeneracies, testing::IsEmpty()) << "no angle is seen";
  const data::Fit seen = fit_top(circling_track(true), {});
  ASSERT_EQ(seen.broken_degeneracies.size(), 1U);
  const data::BrokenDegeneracy& broken = seen.broken_degeneracies.front();
  EXPECT_EQ(broken.readings, "tilt");
  EXPECT_THAT(broken.parameters, testing::IsSupersetOf({"l_m", "theta_rad"}));
  EXPECT_THAT(broken.words, testing::HasSubstr("without the tilt"));
}

// Where the noise has a line that looks like nutation, a and b would come out to half a per cent.
TEST(SteadyPrecession, HidesAAndBThoughTheTiltIsSeenAndTellsTheLength) {
  for (int seed = 1; seed <= 12; ++seed) {
    const data::Fit fit = fit_top(circling_track(true, seed), {});
    for (const char* name : {"a_1_s2", "b_1_s"})
      EXPECT_FALSE(fit.find(name)->identifiable) << name << ", seed " << seed;
    EXPECT_LT(pull(fit, "l_m", 0.05), kFar) << "seed " << seed;
    EXPECT_THAT(fit.warnings, testing::Contains(testing::HasSubstr("no nutation is seen")));
  }
}

TEST(SteadyPrecession, TellsBAtASeenTiltWhereAIsKnown) {
  const data::Track track = circling_track(true);
  data::Scene scene;
  scene.model.name = "top";
  constexpr double kA_1_s2 = 200.0, kRate_rad_s = 6.0;
  scene.fit.prior["a_1_s2"] = {kA_1_s2, 2.0};
  const data::Fit fit = fitting::fit(std::span(&track, 1), scene);
  EXPECT_TRUE(fit.find("a_1_s2")->identifiable);
  EXPECT_TRUE(fit.find("b_1_s")->identifiable);
  EXPECT_LT(pull(fit, "b_1_s", kA_1_s2 / kRate_rad_s + kRate_rad_s * std::cos(0.8)), kFar);
}

TEST(SteadyPrecession, HidesAAndBBehindGlitchesToo) {
  data::Track track = circling_track(true);
  for (const std::size_t i : {30U, 77U, 78U, 150U}) track.samples[i].centre_m.x() += 0.01;
  for (const std::size_t i : {12U, 100U}) track.samples[i].theta->value_rad = 1.3;
  const data::Fit fit = fit_top(track, {});
  for (const char* name : {"a_1_s2", "b_1_s"}) EXPECT_FALSE(fit.find(name)->identifiable) << name;
}

// No nutation tells a and b, whatever a mark shows of the spin.
TEST(BrokenDegeneracies, AreNotThoseOfWhatACircleHides) {
  data::Track track = circling_track(false);
  for (data::TrackSample& sample : track.samples)
    sample.psi = data::MeasuredAngle{30.0 * sample.t_s, 0.01};
  const data::Fit fit = fit_top(track, {});
  for (const data::BrokenDegeneracy& broken : fit.broken_degeneracies)
    for (const std::string& name : broken.parameters)
      EXPECT_TRUE(fit.find(name)->identifiable) << broken.words;
}

// "Without the spin seen in the recording, omega_s_rad_s would not be known": it was b I / Is.
TEST(BrokenDegeneracies, AreNotThoseOfASpinThatTheMomentsTell) {
  data::Track track = thesis_track(25.0, 2e-4, 1);
  const Eigen::VectorXd spin = thesis_motion(25.0, {model::Observable::psi_rad});
  for (std::size_t i = 0; i < track.samples.size(); ++i)
    track.samples[i].psi = data::MeasuredAngle{spin[static_cast<Eigen::Index>(i)], 0.01};
  data::Scene scene = top();
  const data::Fit unknown = fit_of(track, scene);
  ASSERT_EQ(unknown.broken_degeneracies.size(), 1U);
  EXPECT_THAT(unknown.broken_degeneracies.front().parameters,
              testing::ElementsAre("omega_s_rad_s"));
  scene.body.emplace().kind = data::BodyKind::top;
  scene.body->I_kg_m2 = 0.04;
  scene.body->Is_kg_m2 = 0.01;
  EXPECT_THAT(fit_of(track, scene).broken_degeneracies, testing::IsEmpty());
}

TEST(BrokenDegeneracies, AreNoneWhereThePathTellsAsMuch) {
  data::Track track = thesis_track(25.0, 2e-4, 1);
  const Eigen::VectorXd tilt = thesis_motion(25.0, {model::Observable::theta_rad});
  for (std::size_t i = 0; i < track.samples.size(); ++i)
    track.samples[i].theta = data::MeasuredAngle{tilt[static_cast<Eigen::Index>(i)], 0.01};
  EXPECT_THAT(fit_top(track, {}).broken_degeneracies, testing::IsEmpty());
}

}  // namespace
}  // namespace trochoid::fitting
