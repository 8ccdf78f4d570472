#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>

#include "observe/arcs.hpp"
#include "observe/segments.hpp"
#include "problem/problem.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/model/predictor.hpp"

// What of a track is fitted, and what is said where nothing can be.
namespace trochoid::fitting {
namespace {

constexpr double kStep_s = 0.02;

// A spin angle that follows a given one.
template <class Angle>
data::Track turning(int samples, Angle&& angle_rad) {
  data::Track track;
  for (int i = 0; i < samples; ++i) {
    data::TrackSample sample;
    sample.frame = 100 + i;
    sample.t_s = kStep_s * i;
    sample.psi = data::MeasuredAngle{angle_rad(sample.t_s), 0.01};
    track.samples.push_back(sample);
  }
  return track;
}

std::string refusal(const data::Track& track, const std::string& from, const std::string& to) {
  try {
    static_cast<void>(chosen_range(track, from, to));
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Pieces, ABoundBeyondTheTrackIsRefusedWithWhatTheTrackHas) {
  const data::Track track = turning(51, [](double) { return 0.0; });
  EXPECT_EQ(chosen_range(track, "0.5", "f140"), SampleRange(25, 41));
  for (const auto& message : {refusal(track, "1.5", ""), refusal(track, "f151", ""),
                              refusal(track, "", "f99"), refusal(track, "f130", "0.2")}) {
    EXPECT_THAT(message, testing::HasSubstr("runs from 0 to 1 s")) << message;
    EXPECT_THAT(message, testing::HasSubstr("frames 100 to 150")) << message;
  }
  for (const auto& message : {refusal(track, "0.8", "0.2"), refusal(track, "f130", "f120")})
    EXPECT_THAT(message, testing::HasSubstr("exchange them")) << message;
  EXPECT_THAT(refusal(track, "late", ""), testing::HasSubstr("from = 'late': give seconds"));
}

// A puck that slides along x, seen every kStep_s to a few micrometres.
template <class Place>
std::vector<SampleRange> slides_of(Place&& x_m) {
  constexpr int kSamples = 60;
  constexpr double kSigma_m = 2e-6;
  data::Track track;
  for (int i = 0; i < kSamples; ++i) {
    data::TrackSample sample;
    sample.t_s = kStep_s * i;
    const double share = i / (kSamples - 1.0), scatter_m = i % 2 == 0 ? kSigma_m : -kSigma_m;
    sample.centre_m = Eigen::Vector2d(x_m(share) + scatter_m, scatter_m);
    sample.covariance_m2 = Eigen::Matrix2d::Identity() * kSigma_m * kSigma_m;
    track.samples.push_back(sample);
  }
  return sliding_ranges(track, {0, kSamples});
}

// Of the term of fifth degree a cubic leaves 10 / 512 (Chebyshev), 0.08 mm or 40 times the noise.
TEST(Pieces, ASlideIsOneHoweverItsFrictionChangesAndTwoWhereItIsHit) {
  const auto slowed_ever_more = [](double u) {
    return 0.1 * u - 0.03 * u * u - 0.004 * std::pow(u, 5);
  };
  EXPECT_EQ(slides_of(slowed_ever_more).size(), 1U);
  const auto hit_in_the_middle = [&](double u) {
    return slowed_ever_more(u) - 0.02 * std::max(0.0, u - 0.5);
  };
  EXPECT_EQ(slides_of(hit_in_the_middle).size(), 2U);
}

// Held for a second, pushed for half a second to 20 rad/s, then free.
TEST(Pieces, ASpinIsLetGoWhenThePushEnds) {
  constexpr double kHeld_s = 1.0, kPush_s = 0.5, kSpin_rad_s = 20.0, kSpeedWindow_s = 8 * kStep_s;
  const data::Track pushed = turning(300, [=](double t_s) {
    const double push = std::clamp(t_s - kHeld_s, 0.0, kPush_s);
    const double free = std::max(0.0, t_s - kHeld_s - kPush_s);
    return kSpin_rad_s * (0.5 * push * push / kPush_s + free - 0.05 * free * free);
  });
  const double released_s = kStep_s * released_at(pushed, {0, 300});
  EXPECT_GE(released_s, kHeld_s + kPush_s - kStep_s);
  EXPECT_LE(released_s, kHeld_s + kPush_s + kSpeedWindow_s);
}

TEST(Pieces, ASpinThatIsFreeFromTheFirstSampleOnIsTakenWhole) {
  const data::Track free = turning(300, [=](double t_s) { return 20.0 * t_s - t_s * t_s; });
  EXPECT_EQ(released_at(free, {7, 300}), 7);
  // A pendulum let go from rest gets fast slowly: nothing pushes it.
  const data::Track pendulum = turning(300, [=](double t_s) { return 2.0 * std::cos(1.5 * t_s); });
  EXPECT_EQ(released_at(pendulum, {0, 300}), 0);
}

TEST(Pieces, ATrackWithoutFrameNumbersIsRefusedWithoutThem) {
  data::Track track = turning(51, [](double) { return 0.0; });
  EXPECT_THAT(refusal(track, "1.5", ""), testing::HasSubstr("frames"));
  for (data::TrackSample& sample : track.samples) sample.frame = -1;
  EXPECT_THAT(refusal(track, "1.5", ""), testing::EndsWith("runs from 0 to 1 s"));
  EXPECT_THAT(refusal(track, "f99", ""), testing::EndsWith("without a column frame"));
}

TEST(Pieces, WhyNoStartLedAnywhereIsTheCommonestReason) {
  Shortfalls none;
  EXPECT_THAT(none.words(), testing::HasSubstr("no start could be made from the track"));
  Shortfalls some;
  for (int i = 0; i < 3; ++i) some.count(model::Outcome::out_of_domain);
  some.count(model::Outcome::flat);
  EXPECT_THAT(some.words(), testing::HasSubstr("4 attempts"));
  EXPECT_THAT(some.words(), testing::HasSubstr("3 of them"));
  EXPECT_THAT(some.words(),
              testing::HasSubstr("Parameters or state left the model's range; are the body"));
  some.departed = 5;
  EXPECT_THAT(some.words(), testing::HasSubstr("of 5 starts none explains more than a part"));
}

data::Scene slanting_disc() {
  data::Scene scene;
  data::Body& body = scene.body.emplace();
  body.kind = data::BodyKind::disc;
  body.radius_m = 0.03;
  body.thickness_m = 0.002;
  body.mass_kg = 0.02;
  scene.model.name = "rolling";
  scene.start.theta_rad = 0.4;
  scene.start.w1_rad_s = scene.start.w2_rad_s = scene.start.w3_rad_s = 0.0;
  return scene;
}

// A disc let go at a slant topples within a fifth of a second; the track goes on for two.
TEST(Pieces, ABodyThatFellFlatLiesStillFromThenOn) {
  const data::Scene scene = slanting_disc();
  const auto predictor = model::make_predictor(scene);
  data::Track track = turning(100, [](double) { return 0.0; });
  for (data::TrackSample& sample : track.samples) {
    sample.psi.reset();
    sample.centre_m = Eigen::Vector2d::Zero();
    sample.covariance_m2 = Eigen::Matrix2d::Identity();
  }
  const Problem problem = make_problem(*predictor, {make_arc(track, 0, 100, {}, true)}, scene);
  Eigen::VectorXd residuals;
  Eigen::MatrixXd jacobian;
  ASSERT_TRUE(evaluate(problem, 0, problem.start(), residuals, &jacobian));
  const Eigen::Index rows = residuals.size();
  ASSERT_EQ(rows, 200);
  for (Eigen::Index row = rows / 2; row < rows; ++row) {
    EXPECT_EQ(residuals[row], residuals[row - 2]) << row;
    EXPECT_EQ((jacobian.row(row) - jacobian.row(row - 2)).norm(), 0.0) << row;
  }
  EXPECT_NE(residuals[1], residuals[rows - 1]) << "it has moved before";
}

// A term such as an air couple has a coefficient across the axis and one along it.
TEST(Pieces, WhatIsSaidOfAGroupHoldsForThoseOfItsParametersThatAreNotNamed) {
  data::Scene scene = slanting_disc();
  scene.model.air_linear_N_m_s = Eigen::Vector3d(1e-6, 1e-6, 3e-6);
  scene.model.air_quadratic_N_m_s2 = Eigen::Vector3d(1e-7, 1e-7, 3e-7);
  scene.fit.fixed = {{"air_linear_N_m_s", 2e-6}, {"air_linear_N_m_s[3]", 5e-6}};
  scene.fit.bounds = {{"air_quadratic_N_m_s2", {1e-8, 1e-6}}};
  scene.fit.prior = {{"air_quadratic_N_m_s2", {1e-7, 1e-8}},
                     {"air_quadratic_N_m_s2[3]", {4e-7, 1e-8}}};
  const auto predictor = model::make_predictor(scene);
  const Problem problem = make_problem(*predictor, {ArcData{}}, scene);
  std::map<std::string, const FreeParameter*> free;
  for (std::size_t i = 0; i < problem.free.size(); ++i)
    free[problem.name(static_cast<int>(i))] = &problem.free[i];
  for (const auto& [name, value_N_m_s] :
       {std::pair("air_linear_N_m_s[1]", 2e-6), std::pair("air_linear_N_m_s[3]", 5e-6)}) {
    EXPECT_FALSE(free.contains(name)) << name;
    EXPECT_EQ(problem.base[0][predictor->index_of(name)], value_N_m_s) << name;
  }
  for (const auto& [name, value_N_m_s2] :
       {std::pair("air_quadratic_N_m_s2[1]", 1e-7), std::pair("air_quadratic_N_m_s2[3]", 4e-7)}) {
    ASSERT_TRUE(free.contains(name)) << name;
    EXPECT_EQ(free[name]->transform.kind, Transform::Kind::between) << name;
    ASSERT_TRUE(free[name]->prior) << name;
    EXPECT_EQ(free[name]->prior->value, value_N_m_s2) << name;
  }
}

// A start at the bound, or on its far side, from where a minimiser takes a few steps to anywhere.
TEST(Pieces, AStartOnABoundOfZeroBeginsInsideOfIt) {
  data::Scene scene;
  scene.model.name = "top";
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  scene.fit.bounds = {{"dphi_rad_s", {0.0, kInfinity}}, {"dtheta_rad_s", {-kInfinity, 0.0}}};
  const auto predictor = model::make_predictor(scene);
  Problem problem = make_problem(*predictor, {ArcData{}}, scene);
  for (const auto& [name, beyond] : {std::pair("dphi_rad_s", -2.0), {"dtheta_rad_s", 2.0}})
    for (const double start : {0.0, beyond}) {
      const int index = predictor->index_of(name);
      problem.base[0][index] = start;
      const auto free = std::find_if(problem.free.begin(), problem.free.end(),
                                     [&](const FreeParameter& p) { return p.index == index; });
      const double u = problem.start()[free - problem.free.begin()];
      EXPECT_LT(free->transform.value(u) * beyond, 0.0) << name;
      EXPECT_GE(std::abs(free->transform.slope(u)), 1e-4) << name;  // rad/s a unit of u
    }
}

// The minimiser draws a reading, d scaled sigmas off, back with a force of w^2 d: the cost of
// getting there is the integral of that.
TEST(Pieces, WhatStandsOutCostsWhatItTookToGetThere) {
  const auto weight = [](double d) { return std::min(1.0, kInlier * kInlier / (d * d)); };
  for (const double d : {1.0, 4.0, 12.0, 1000.0}) {
    Problem problem;
    problem.arcs.resize(1);
    problem.arcs[0].readings.resize(1);
    problem.arcs[0].rows = 2;
    problem.row_weights = {Eigen::Vector2d::Constant(weight(d))};
    constexpr int kSteps = 200000;
    double twice_cost = 0.0;
    for (int i = 0; i < kSteps; ++i) {
      const double s = d * (i + 0.5) / kSteps;
      twice_cost += 2.0 * weight(s) * weight(s) * s * d / kSteps;
    }
    const double squares = std::pow(weight(d) * d, 2);
    EXPECT_NEAR(squares + cost_of_standing_out(problem, Channel::position), twice_cost, 1e-3) << d;
  }
}

}  // namespace
}  // namespace trochoid::fitting
