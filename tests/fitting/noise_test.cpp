#include "observe/noise.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <numbers>
#include <random>

#include "trochoid/fitting/fit.hpp"
#include "trochoid/model/predictor.hpp"

// Errors of a track that hang together in time.
namespace trochoid::fitting {
namespace {

Eigen::MatrixXd correlation_of(const NoiseKind& kind, Eigen::Index n) {
  Eigen::MatrixXd r = Eigen::MatrixXd::Identity(n, n);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j)
      if (i != j) r(i, j) = kind.share * std::pow(kind.rho, std::abs(static_cast<double>(i - j)));
  return r;
}

Eigen::VectorXd autoregressive(double rho, Eigen::Index n, std::mt19937_64& generator) {
  std::normal_distribution<double> normal;
  Eigen::VectorXd noise(n);
  double last = normal(generator);
  for (double& value : noise) {
    value = last;
    last = rho * last + std::sqrt(1.0 - rho * rho) * normal(generator);
  }
  return noise;
}

NoiseGroup alone(const Eigen::VectorXd& residual) {
  return {{residual, Eigen::MatrixXd(residual.size(), 0)}};
}

double expected_inflation(const NoiseEvidence& evidence) {
  double sum = 0.0;
  for (const NoiseKind& kind : evidence.kinds) sum += kind.posterior * kind.inflation();
  return sum;
}

TEST(Noise, IsSeenThroughItsCorrelationMatrix) {
  const NoiseKind kind{0.7, 0.8};
  const Eigen::MatrixXd x = Eigen::MatrixXd::Random(40, 3);
  const Eigen::MatrixXd direct = x.transpose() * correlation_of(kind, 40) * x;
  EXPECT_TRUE(seen_through(kind, x).isApprox(direct, 1e-12));
}

TEST(Noise, IsIndependentOnceItsCorrelationIsTakenOut) {
  const NoiseKind kind{0.7, 0.8};
  const Eigen::MatrixXd w = decorrelated(kind, Eigen::MatrixXd::Identity(40, 40));
  // W R W^T = 1 for W the filter.
  EXPECT_TRUE((w * correlation_of(kind, 40) * w.transpose()).isIdentity(1e-10));
}

TEST(Noise, OfAWhiteRecordIsTakenForWhite) {
  std::mt19937_64 generator(3);
  int taken_for_white = 0;
  for (int record = 0; record < 40; ++record) {
    const NoiseEvidence evidence = noise_evidence({alone(autoregressive(0.0, 200, generator))});
    for (const NoiseKind& kind : evidence.kinds)
      taken_for_white += kind.share == 0.0 && kind.posterior > 0.5;
  }
  EXPECT_GE(taken_for_white, 36);
}

TEST(Noise, ThatHangsTogetherIsFoundToDoSo) {
  std::mt19937_64 generator(4);
  std::vector<NoiseGroup> records;
  for (int record = 0; record < 5; ++record)
    records.push_back(alone(autoregressive(0.8, 300, generator)));
  // (1 + rho)/(1 - rho) = 9; 1500 samples tell it to a fifth.
  EXPECT_NEAR(expected_inflation(noise_evidence(records)), 9.0, 3.0);
}

// Six slow parameters follow most of what a short record shows of its slow noise.
TEST(Noise, IsNotUnderratedBecauseParametersFollowIt) {
  std::mt19937_64 generator(5);
  constexpr Eigen::Index kSamples = 60;
  Eigen::MatrixXd waves(kSamples, 6);
  for (Eigen::Index i = 0; i < kSamples; ++i)
    for (Eigen::Index j = 0; j < 6; ++j)
      waves(i, j) = std::cos(std::numbers::pi * static_cast<double>(j) *
                             (static_cast<double>(i) + 0.5) / static_cast<double>(kSamples));
  waves.colwise().normalize();
  std::vector<NoiseGroup> blind, aware;
  for (int record = 0; record < 40; ++record) {
    Eigen::VectorXd noise = autoregressive(0.8, kSamples, generator);
    noise -= waves * (waves.transpose() * noise);
    blind.push_back(alone(noise));
    aware.push_back({{noise, waves}});
  }
  EXPECT_LT(expected_inflation(noise_evidence(blind)), 6.0);
  EXPECT_NEAR(expected_inflation(noise_evidence(aware)), 9.0, 3.0);
}

// 61 samples of the thesis' top over 2.7 nutations, errors with a correlation of 0.6 from sample to
// sample.
TEST(ErrorBars, HoldTheTruthWhereErrorsHangTogether) {
  data::Scene scene;
  scene.model.name = "top";
  const auto predictor = model::make_predictor(scene);
  Eigen::VectorXd values = Eigen::VectorXd::Zero(predictor->parameters().size());
  const std::map<std::string, double> truth{
      {"a_1_s2", 0.098}, {"b_1_s", 0.75}, {"l_m", 0.1}, {"theta_rad", std::numbers::pi / 3.0}};
  for (const auto& [name, value] : truth) values[predictor->index_of(name)] = value;
  constexpr int kSamples = 61, kDraws = 40;
  constexpr double kSigma_m = 5e-4;
  std::vector<double> t_s;
  for (int i = 0; i < kSamples; ++i) t_s.push_back(25.0 * i / (kSamples - 1));
  model::PredictRequest request;
  request.t_s = t_s;
  const Eigen::VectorXd exact = predictor->predict(values, request).values;
  std::mt19937_64 generator(6);
  double distance = 0.0;
  for (int draw = 0; draw < kDraws; ++draw) {
    const Eigen::VectorXd x = autoregressive(0.6, kSamples, generator);
    const Eigen::VectorXd y = autoregressive(0.6, kSamples, generator);
    data::Track track;
    for (int i = 0; i < kSamples; ++i) {
      data::TrackSample sample;
      sample.t_s = t_s[static_cast<std::size_t>(i)];
      sample.centre_m = exact.segment<2>(2 * i) + kSigma_m * Eigen::Vector2d(x[i], y[i]);
      sample.covariance_m2 = Eigen::Matrix2d::Identity() * kSigma_m * kSigma_m;
      track.samples.push_back(sample);
    }
    const data::Fit result = fit(std::span(&track, 1), scene);
    ASSERT_TRUE(result.converged) << result.reason;
    Eigen::VectorXd error(result.covariance.rows());
    for (Eigen::Index i = 0; i < error.size(); ++i) {
      const std::string& name = result.covariance_names[static_cast<std::size_t>(i)];
      error[i] = result.find(name)->value - values[predictor->index_of(name)];
    }
    distance += error.dot(result.covariance.ldlt().solve(error)) /
                static_cast<double>(error.size()) / kDraws;
  }
  // Its own spread is sqrt(2/(7 x 40)) = 0.08; four of these.
  EXPECT_NEAR(distance, 1.0, 0.35);
}

}  // namespace
}  // namespace trochoid::fitting
