#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "common.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/fitting/fit.hpp"
#include "trochoid/model/predictor.hpp"

// Samples that were not taken when their time stamps say.
namespace trochoid::fitting {
namespace {

constexpr double kFrameSigma_m = 1e-4, kSigma_rad = 2e-3, kFrame_s = 1.0 / 60.0;
constexpr double kRows = 1080.0, kScale_px_per_m = 5000.0;
constexpr int kFrames = 240;
constexpr double kA_1_s2 = 20.0, kB_1_s = 9.0, kL_m = 0.1;

data::Scene scene() {
  data::Scene scene;
  scene.model.name = "top";
  scene.support.kind = data::SupportKind::pivot;
  scene.support.pivot_m = Eigen::Vector3d::Zero();
  scene.camera.rows = kRows;
  return scene;
}

struct TopSeen {
  double x_m, y_m, phi_rad;
};

// A nutating top at any instant after the first tenth of a second.
TopSeen top_at(double t_s) {
  static const auto predictor = model::make_predictor(scene());
  static const Eigen::VectorXd values = [] {
    Eigen::VectorXd v(predictor->parameters().size());
    for (Eigen::Index i = 0; i < v.size(); ++i) v[i] = predictor->parameters()[i].value;
    v[predictor->index_of("a_1_s2")] = kA_1_s2;
    v[predictor->index_of("b_1_s")] = kB_1_s;
    v[predictor->index_of("l_m")] = kL_m;
    v[predictor->index_of("theta_rad")] = 0.7;
    return v;
  }();
  const std::vector<double> t{t_s + 0.1};
  model::PredictRequest request;
  request.t_s = t;
  request.observables = {model::Observable::x_m, model::Observable::y_m,
                         model::Observable::phi_rad};
  request.tolerance = 1e-10;
  const Eigen::VectorXd seen = predictor->predict(values, request).values;
  return {seen[0], seen[1], seen[2]};
}

double row_of(double y_m) {
  return 0.5 * kRows - kScale_px_per_m * y_m;
}

// Each row is read `readout_s` row/(rows - 1) after the time stamp; angles are from `delay_s`
// later.
data::Track filmed(double readout_s, double delay_s, bool angles) {
  std::mt19937_64 generator(5);
  std::normal_distribution<double> normal;
  data::Track track;
  for (int i = 0; i < kFrames; ++i) {
    const double stamp_s = i * kFrame_s;
    double taken_s = stamp_s;  // at the row it is then seen in
    for (int round = 0; round < 20; ++round)
      taken_s = stamp_s + readout_s * row_of(top_at(taken_s).y_m) / (kRows - 1.0);
    const TopSeen seen = top_at(taken_s);
    data::TrackSample sample;
    sample.t_s = stamp_s;
    sample.centre_m = {seen.x_m + kFrameSigma_m * normal(generator),
                       seen.y_m + kFrameSigma_m * normal(generator)};
    sample.covariance_m2 = Eigen::Matrix2d::Identity() * kFrameSigma_m * kFrameSigma_m;
    sample.centre_px = {0.0, row_of(seen.y_m)};
    if (angles)
      sample.phi = {top_at(taken_s + delay_s).phi_rad + kSigma_rad * normal(generator), kSigma_rad};
    track.samples.push_back(sample);
  }
  return track;
}

TEST(Timing, FindsTheReadoutOfARollingShutter) {
  constexpr double kReadout_s = 0.012;
  const data::Track track = filmed(kReadout_s, 0.0, false);
  data::Scene with = scene();
  with.fit.free = {"readout_s"};
  const data::Fit fit = fit_of(track, with);
  ASSERT_TRUE(fit.converged) << fit.reason;
  EXPECT_LT(pull(fit, "readout_s", kReadout_s), kFar);
  EXPECT_LT(fit.find("readout_s")->sigma, 0.1 * kReadout_s);
  EXPECT_LT(pull(fit, "a_1_s2", kA_1_s2), kFar);
  EXPECT_LT(pull(fit, "b_1_s", kB_1_s), kFar);
  // Left out, it bends the parameters by many of their error bars, or is not explained.
  const data::Fit without = fit_of(track, scene());
  EXPECT_TRUE(!without.converged || without.chi2 > 2.0 * fit.chi2);
}

TEST(Timing, CountsOnFromTheReadoutTheTrackAllowedFor) {
  constexpr double kReadout_s = 0.012, kAllowed_s = 0.010;
  data::Track track = filmed(kReadout_s, 0.0, false);
  for (data::TrackSample& sample : track.samples)
    sample.t_s += kAllowed_s * sample.centre_px.y() / (kRows - 1.0);
  data::Scene with = scene();
  with.camera.readout_s = kAllowed_s;
  with.fit.prior["readout_s"] = {kAllowed_s, 0.005};
  const data::Fit fit = fit_of(track, with);
  ASSERT_TRUE(fit.converged) << fit.reason;
  EXPECT_LT(pull(fit, "readout_s", kReadout_s), kFar);
  EXPECT_GT(pull(fit, "readout_s", kAllowed_s), kFar);
}

TEST(Timing, FindsHowMuchLaterAnglesAreThanPositions) {
  for (const double delay_s : {0.007, -0.009}) {
    data::Scene with = scene();
    with.fit.free = {"angle_delay_s"};
    const data::Fit fit = fit_of(filmed(0.0, delay_s, true), with);
    ASSERT_TRUE(fit.converged) << fit.reason;
    EXPECT_LT(pull(fit, "angle_delay_s", delay_s), kFar);
    EXPECT_LT(fit.find("angle_delay_s")->sigma, 1e-3);
    EXPECT_LT(pull(fit, "a_1_s2", kA_1_s2), kFar);
  }
}

// "Without the precession seen in the recording, angle_delay_s would not be known."
TEST(Timing, OfAnglesIsNoDegeneracyThatTheseBreak) {
  data::Scene with = scene();
  with.fit.prior["angle_delay_s"] = {0.0, 0.1};
  for (const auto& broken : fit_of(filmed(0.0, 0.007, true), with).broken_degeneracies)
    EXPECT_THAT(broken.parameters, testing::Not(testing::Contains("angle_delay_s")));
}

TEST(Timing, AsksForTheImagesHeight) {
  data::Scene with = scene();
  with.camera.rows.reset();
  with.fit.free = {"readout_s"};
  try {
    (void)fit_of(filmed(0.0, 0.0, false), with);
    FAIL() << "no error";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("[camera] rows"));
  }
}

}  // namespace
}  // namespace trochoid::fitting
