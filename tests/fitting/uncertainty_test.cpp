#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "trochoid/fitting/fit.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::fitting {
namespace {

// The thesis' base case, 10 s (a little more than one nutation) unless told otherwise.
data::Track thesis_track(double duration_s, double sigma_m, std::uint64_t seed) {
  data::Scene scene;
  scene.model.name = "top";
  const auto predictor = model::make_predictor(scene);
  Eigen::VectorXd values = Eigen::VectorXd::Zero(predictor->parameters().size());
  values[predictor->index_of("a_1_s2")] = 0.098;
  values[predictor->index_of("b_1_s")] = 0.75;
  values[predictor->index_of("l_m")] = 0.1;
  values[predictor->index_of("theta_rad")] = M_PI / 3.0;
  std::vector<double> t_s;
  for (int i = 0; i < 250; ++i) t_s.push_back(duration_s * i / 249.0);
  model::PredictRequest request;
  request.t_s = t_s;
  const model::Prediction exact = predictor->predict(values, request);
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal(0.0, sigma_m);
  data::Track track;
  for (int i = 0; i < 250; ++i) {
    data::TrackSample sample;
    sample.t_s = t_s[i];
    sample.centre_m = exact.values.segment<2>(2 * i);
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
    EXPECT_EQ(profile.verdict, "bounded");
    // 0.2 % noise over 2.5 nutations: curvature changes the interval by a few per cent.
    const double half = 1.96 * parameter.sigma;
    EXPECT_NEAR(profile.upper_95 - parameter.value, half, 0.1 * half) << name;
    EXPECT_NEAR(parameter.value - profile.lower_95, half, 0.1 * half) << name;
    EXPECT_TRUE(std::is_sorted(profile.values.begin(), profile.values.end()));
    EXPECT_EQ(profile.values.size(), profile.delta_chi2.size());
  }
}

TEST(ProfileLikelihood, IsNotBoundedOnBothSidesByAFractionOfANutation) {
  FitOptions options;
  options.profile = true;
  const data::Fit result = fit_top(thesis_track(2.0, 1e-3, 2), options);
  // A fifth of a nutation does not tell an infinite length from a long one.
  EXPECT_THAT(profile_of(result, "l_m").verdict, testing::AnyOf("one-sided", "flat"));
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

}  // namespace
}  // namespace trochoid::fitting
