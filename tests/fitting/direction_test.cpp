#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

#include "observe/observations.hpp"
#include "problem/prepare.hpp"
#include "problem/problem.hpp"
#include "trochoid/fitting/fit.hpp"
#include "trochoid/model/predictor.hpp"
#include "values_with.hpp"

// Tilt and precession of one picture are a direction of the body's axis.
namespace trochoid::fitting {
namespace {

// As a tracker reports it, with standard deviations.
struct Seen {
  double theta_rad, sigma_theta_rad, phi_rad, sigma_phi_rad;
};

enum class Faces { alike, different };

ArcData arc_with(const Seen& seen, Faces faces) {
  data::Track track;
  data::TrackSample sample;
  sample.theta = data::MeasuredAngle{seen.theta_rad, seen.sigma_theta_rad};
  sample.phi = data::MeasuredAngle{seen.phi_rad, seen.sigma_phi_rad};
  track.samples.push_back(sample);
  return make_arc(track, 0, 1, {.position = false, .theta = true, .phi = true},
                  faces == Faces::alike);
}

// Whitened residuals of a predicted direction.
Eigen::VectorXd residuals(const Seen& seen, const Eigen::Vector2d& predicted, Faces faces,
                          Eigen::MatrixXd* by_angles = nullptr) {
  Eigen::VectorXd out;
  whiten(arc_with(seen, faces), predicted, Eigen::Matrix2d::Identity(), out, by_angles);
  return out;
}

double misfit(const Seen& seen, const Eigen::Vector2d& predicted, Faces faces = Faces::alike) {
  return residuals(seen, predicted, faces).norm();
}

constexpr double kTurn = 2.0 * std::numbers::pi;

TEST(Direction, OfABodyThatLiesFlatHasNoPrecessionThatCouldBeMissed) {
  constexpr double kFlat_rad = 0.02;
  const Seen seen{0.25, 0.05, 1.0, 0.1};
  // 0.02 rad either way are 0.4 sigma along the meridian, 0.8 sigma along the parallel.
  constexpr double kOneSigma = 1.0;
  const double there = misfit(seen, {kFlat_rad, seen.phi_rad});
  for (double turned = 0.0; turned < kTurn; turned += 0.1)
    EXPECT_NEAR(misfit(seen, {kFlat_rad, seen.phi_rad + turned}), there, kOneSigma) << turned;
}

TEST(Direction, ReachesItsMirrorImageWhereTheTiltMayBeNothing) {
  const Seen unsure{0.25, 0.35, 1.0, 0.1}, sure{0.25, 0.035, 1.0, 0.1};
  const Eigen::Vector2d mirrored(0.17, 1.0 + std::numbers::pi);
  EXPECT_NEAR(misfit(unsure, mirrored), (0.25 + 0.17) / 0.35, 0.01);
  EXPECT_NEAR(misfit(sure, mirrored), (0.25 + 0.17) / 0.035, 0.1);
}

TEST(Direction, OfAnAxisWhoseEndsLookAlikeIsThatOfTheNearerEnd) {
  const Seen seen{1.55, 0.02, 1.0, 0.02};
  const Eigen::Vector2d beyond_upright(1.60, 1.0);
  EXPECT_NEAR(misfit(seen, beyond_upright), 0.05 / 0.02, 0.01);
  EXPECT_NEAR(misfit(seen, {std::numbers::pi - 1.60, 1.0 + std::numbers::pi}), 0.05 / 0.02, 0.01);
}

TEST(Direction, IsAsFarOffAsTheAngleBetweenBoth) {
  // Errors alike in all directions: by 1 / 0.01 of the angle, over the pole as well.
  const Seen seen{0.4, 0.01, 1.0, 0.01 / std::sin(0.4)};
  EXPECT_NEAR(misfit(seen, {0.3, 1.0 + std::numbers::pi}, Faces::different), 70.0, 1e-9);
  EXPECT_NEAR(misfit(seen, {1.9, 1.0}, Faces::different), 150.0, 1e-9);
  EXPECT_NEAR(misfit(seen, {0.4, 1.5}, Faces::different),
              200.0 * std::asin(std::sin(0.4) * std::sin(0.25)), 1e-9);
}

// Up to the axis turned over, from which every way is as long: nothing draws a fit there.
TEST(Direction, IsFarthestFromTheOppositeAxis) {
  const Seen seen{0.7, 0.1, 1.0, 0.1 / std::sin(0.7)};
  double before = 0.0;
  for (double off = 2.5; off < std::numbers::pi; off += 0.05) {
    const double there = misfit(seen, {seen.theta_rad + off, seen.phi_rad}, Faces::different);
    EXPECT_GE(there, before - 1e-9) << off;
    before = there;
  }
  constexpr double kFar = 25.0;  // standard deviations
  EXPECT_GT(before, kFar);
  const Eigen::Vector2d opposite(std::numbers::pi - seen.theta_rad,
                                 seen.phi_rad + std::numbers::pi);
  Eigen::MatrixXd by_angles;
  EXPECT_GT(residuals(seen, opposite, Faces::different, &by_angles).norm(), kFar);
  EXPECT_TRUE(by_angles.allFinite());
}

TEST(Direction, ChangesWithThePredictedAnglesAsItsDerivativesSay) {
  constexpr double kStep_rad = 1e-6, kTolerance = 1e-6;  // of the largest; differences cancel
  const Seen seen{0.5, 0.03, 1.0, 0.02};
  for (const Faces faces : {Faces::alike, Faces::different})
    for (const Eigen::Vector2d& at :
         {Eigen::Vector2d(0.5, 1.0001), Eigen::Vector2d(0.52, 1.03), Eigen::Vector2d(0.05, 3.0),
          Eigen::Vector2d(0.4, 4.0), Eigen::Vector2d(2.0, 1.2), Eigen::Vector2d(2.6, 4.1)}) {
      Eigen::MatrixXd by_angles;
      static_cast<void>(residuals(seen, at, faces, &by_angles));
      for (int k = 0; k < 2; ++k) {
        const Eigen::Vector2d step = kStep_rad * Eigen::Vector2d::Unit(k);
        const Eigen::VectorXd change =
            residuals(seen, at + step, faces) - residuals(seen, at - step, faces);
        EXPECT_LT((change / (2.0 * kStep_rad) - by_angles.col(k)).norm(),
                  kTolerance * by_angles.norm())
            << at.transpose() << " by angle " << k;
      }
    }
}

// A coin that rolls and sinks until it lies flat. Below 0.2 rad its tracker takes shadow for
// tilt: it sees 0.25 rad, towards anywhere while the coin moves and towards the lamp once it rests,
// and is sure of it.
class NearlyFlatCoin : public testing::Test {
 protected:
  NearlyFlatCoin() {
    scene_.body = data::Body{};
    scene_.body->radius_m = 0.012;
    scene_.body->thickness_m = 0.0018;
    scene_.body->mass_kg = 0.0069;
    scene_.model.name = "rolling";
    scene_.model.rolling_friction_m = kTruth.at("rolling_friction_m");
  }

  [[nodiscard]] data::Track track(unsigned seed) const {
    constexpr int kSamples = 240;
    constexpr double kRate_Hz = 60.0;
    constexpr double kLamp_rad = 4.0;
    const auto predictor = model::make_predictor(scene_);
    std::vector<double> t_s;
    for (int i = 0; i < kSamples; ++i) t_s.push_back(i / kRate_Hz);
    model::PredictRequest request;
    request.t_s = t_s;
    request.lies_where_it_fell = true;
    request.observables = {model::Observable::x_m, model::Observable::y_m,
                           model::Observable::theta_rad, model::Observable::phi_rad};
    const model::Prediction exact = predictor->predict(values_with(*predictor, kTruth), request);
    std::mt19937_64 generator(seed);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> anywhere(0.0, kTurn);
    data::Track track;
    for (int i = 0; i < kSamples; ++i) {
      const Eigen::Vector4d at = exact.values.segment<4>(4 * i);
      data::TrackSample sample;
      sample.t_s = t_s[static_cast<std::size_t>(i)];
      sample.centre_m =
          at.head<2>() + kSigma_m * Eigen::Vector2d{normal(generator), normal(generator)};
      sample.covariance_m2 = Eigen::Matrix2d::Identity() * kSigma_m * kSigma_m;
      const bool fooled = at[2] < 0.2;
      const double tilt = fooled ? 0.25 : at[2];
      const double sigma_phi_rad = kSigma_rad / std::sin(tilt);
      const double made_up = at[2] < 0.03 ? kLamp_rad : anywhere(generator);
      const double phi = fooled ? made_up : at[3];
      sample.theta = data::MeasuredAngle{tilt + kSigma_rad * normal(generator), kSigma_rad};
      sample.phi = data::MeasuredAngle{phi + sigma_phi_rad * normal(generator), sigma_phi_rad};
      track.samples.push_back(sample);
    }
    return track;
  }

  static constexpr double kSigma_m = 2e-4, kSigma_rad = 0.04;
  const std::map<std::string, double> kTruth{
      {"rolling_friction_m", 5e-5}, {"theta_rad", 0.35}, {"phi_rad", 1.0}, {"w1_rad_s", 0.0},
      {"w2_rad_s", 33.4},           {"w3_rad_s", -6.0},  {"x_m", 0.0},     {"y_m", 0.0}};
  data::Scene scene_;
};

TEST_F(NearlyFlatCoin, IsNotGivenALossByDirectionsThatItsTrackerMadeUp) {
  constexpr double kSigmas = 4.0;    // one in a thousand of 40 values
  constexpr double kEvidence = 2.0;  // of BIC: worth a mention
  data::Scene with_gap = scene_;
  with_gap.model.gap_viscosity_Pa_s = 2e-6;
  for (const unsigned seed : {1U, 2U, 3U, 4U, 5U}) {
    const data::Track made_up = track(seed);
    FitOptions options;
    options.strategy = Strategy::single;
    options.start = kTruth;
    const data::Fit found = fit(std::span(&made_up, 1), scene_, options);
    const data::Fit larger = fit(std::span(&made_up, 1), with_gap, options);
    ASSERT_TRUE(std::isfinite(found.chi2)) << found.reason;
    EXPECT_GT(larger.bic, found.bic - kEvidence) << "seed " << seed;
    for (const auto& [name, truth] : kTruth) {
      const data::FitParameter* parameter = found.find(name);
      ASSERT_NE(parameter, nullptr) << name;
      EXPECT_NEAR(parameter->value, truth, kSigmas * parameter->sigma) << name << ", seed " << seed;
    }
  }
}

// A coin at rest lies with its axis along the vertical: what was seen of the axis is off along its
// meridian and never across.
TEST_F(NearlyFlatCoin, TakenToLieThroughoutIsNotThoughtPreciseAcrossItsAxis) {
  constexpr double kLeast = 1e-3;  // of the scale along the axis
  const data::Track rolls = track(1);
  const auto predictor = model::make_predictor(scene_);
  FitOptions options;
  options.start = kTruth;
  options.start["w2_rad_s"] = 0.0;  // falls within three samples
  Problem problem = prepare(std::span(&rolls, 1), *predictor, scene_, options);
  problem.base[0] = values_with(*predictor, options.start);
  reweight(problem, problem.start(), true);
  const auto scale = [&](Channel channel) { return noise_scale(problem.arcs[0], channel); };
  EXPECT_GT(scale(Channel::theta), 1.0);
  EXPECT_GT(scale(Channel::phi), kLeast * scale(Channel::theta));
}

}  // namespace
}  // namespace trochoid::fitting
