#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "observe/observations.hpp"
#include "start/starts.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/model/inertia.hpp"
#include "trochoid/model/steady.hpp"
#include "values_with.hpp"

// Starts for bodies on their rim, from paths whose motion is known.
namespace trochoid::fitting {
namespace {

constexpr double kSlidingFriction = 0.3;

data::Scene sliding_disc() {
  data::Scene scene;
  data::Body& body = scene.body.emplace();
  body.kind = data::BodyKind::disc;
  body.radius_m = 0.0375;
  body.thickness_m = 0.005;
  body.mass_kg = 0.06;
  scene.model.name = "sliding";
  scene.model.friction = kSlidingFriction;
  return scene;
}

model::RimBody per_mass(const data::Scene& scene) {
  const model::CentralInertia inertia = model::central_inertia(*scene.body);
  return {.A = inertia.transverse_kg_m2 / inertia.mass_kg,
          .C = inertia.axial_kg_m2 / inertia.mass_kg,
          .R = scene.body->radius_m,
          .h = scene.body->half_thickness_m(),
          .g = scene.model.gravity_m_s2};
}

// Velocity of the point of contact in the table's frame: n along the node line, m across it,
// u_n = v_n + R w3 - h w2, u_m = v_m + (R sin theta + h cos theta) w1.
Eigen::Vector2d slip_of(const std::map<std::string, double>& state, const model::RimBody& body) {
  const double theta = state.at("theta_rad"), phi = state.at("phi_rad");
  const Eigen::Vector2d n(std::cos(phi), std::sin(phi)), m(-n.y(), n.x());
  const Eigen::Vector2d v(state.at("vx_m_s"), state.at("vy_m_s"));
  const double z = model::tilt(body, theta).z;
  return (v.dot(n) + body.R * state.at("w3_rad_s") - body.h * state.at("w2_rad_s")) * n +
         (v.dot(m) + z * state.at("w1_rad_s")) * m;
}

data::Track path_of(const data::Scene& scene, const std::map<std::string, double>& state,
                    int samples, double rate_Hz) {
  const auto predictor = model::make_predictor(scene);
  std::vector<double> t_s;
  for (int i = 0; i < samples; ++i) t_s.push_back(i / rate_Hz);
  model::PredictRequest request;
  request.t_s = t_s;
  request.observables.push_back(model::Observable::theta_rad);
  request.observables.push_back(model::Observable::phi_rad);
  const Eigen::VectorXd path = predictor->predict(values_with(*predictor, state), request).values;
  constexpr double kSigma_rad = 0.005;
  data::Track track;
  for (int i = 0; i < samples; ++i) {
    data::TrackSample sample;
    sample.t_s = t_s[static_cast<std::size_t>(i)];
    sample.centre_m = path.segment<2>(4 * i);
    sample.covariance_m2 = Eigen::Matrix2d::Identity() * 1e-10;
    sample.theta = {path[4 * i + 2], kSigma_rad};
    sample.phi = {path[4 * i + 3], kSigma_rad};
    track.samples.push_back(sample);
  }
  return track;
}

// A turning disc whose rim slips at 0.15 m/s when it is let go. One of the starts is it, as near as
// their grid is fine: half of 0.15 rad of tilt and of a twelfth of a turn, and half or twice the
// speed. The friction is that of a body that weighs what it weighs at rest.
TEST(RimStarts, OneOfASlidingBodySlipsAsItDoes) {
  const data::Scene scene = sliding_disc();
  const model::RimBody body = per_mass(scene);
  const std::map<std::string, double> truth{
      {"theta_rad", 0.96}, {"phi_rad", 0.4},   {"w1_rad_s", 0.0},
      {"w2_rad_s", 19.7},  {"w3_rad_s", -0.3}, {"x_m", 0.01},
      {"y_m", -0.02},      {"vx_m_s", 0.165},  {"vy_m_s", 0.124}};
  constexpr int kSamples = 16;
  const data::Track track = path_of(scene, truth, kSamples, 240.0);
  const std::vector<Start> starts = rim_starts(make_arc(track, 0, kSamples, {}, true), body, true);
  const Eigen::Vector2d slip = slip_of(truth, body);
  ASSERT_NEAR(slip.norm(), 0.15, 0.01);
  const auto is_it = [&](const Start& start) {
    const auto off = [&](const char* name) { return start.values.at(name) - truth.at(name); };
    const Eigen::Vector2d its = slip_of(start.values, body);
    constexpr double kHalfTwelfth = std::numbers::pi / 12.0;
    return std::abs(off("theta_rad")) <= 0.076 &&
           std::abs(std::remainder(off("phi_rad"), 2.0 * std::numbers::pi)) <= kHalfTwelfth &&
           its.norm() > 0.5 * slip.norm() && its.norm() < 2.0 * slip.norm() &&
           its.dot(slip) > 0.9 * its.norm() * slip.norm() && start.values.contains("friction") &&
           std::abs(start.values.at("friction") / kSlidingFriction - 1.0) < 0.3;
  };
  EXPECT_TRUE(std::any_of(starts.begin(), starts.end(), is_it));
}

// A disc that spins in place, its rim slipping at 2.5 m/s, as it does at 80 rad/s of spin. The node
// line turns as fast as gravity wants with that spin.
const std::map<std::string, double> kSpinsInPlace{
    {"theta_rad", 0.5}, {"phi_rad", 0.4},    {"w1_rad_s", 0.05},
    {"w2_rad_s", 5.2},  {"w3_rad_s", -80.0}, {"x_m", 0.01},
    {"y_m", -0.02},     {"vx_m_s", 0.02},    {"vy_m_s", -0.01}};

// Where tilt and precession were seen the couples tell the spin: to a tenth, over a window in which
// it changes by half of that. Without slip it would be 0.
TEST(RimStarts, OneSpinsAsFastAsTheTurningOfTheSeenAxisAsks) {
  const data::Scene scene = sliding_disc();
  constexpr int kSamples = 24;
  const data::Track track = path_of(scene, kSpinsInPlace, kSamples, 240.0);
  const ArcData seen =
      make_arc(track, 0, kSamples, {.position = true, .theta = true, .phi = true}, false);
  const double spin = kSpinsInPlace.at("w3_rad_s");
  const std::vector<Start> starts = rim_starts(seen, per_mass(scene), true);
  EXPECT_TRUE(std::any_of(starts.begin(), starts.end(), [&](const Start& start) {
    return std::abs(start.values.at("w3_rad_s") / spin - 1.0) < 0.1;
  }));
}

// A body whose faces differ may stand on its other rim, half its thickness to the other side.
TEST(RimStarts, OfABodyOnItsOtherRimRollsOnThatOne) {
  data::Scene scene = sliding_disc();
  scene.model.name = "rolling";
  const model::RimBody body = per_mass(scene);
  const double theta = 2.2, rate_rad_s = 22.0;
  const double spin = model::steady_rolling_spin(body, theta, rate_rad_s);
  const std::map<std::string, double> truth{
      {"theta_rad", theta}, {"phi_rad", 0.4},
      {"w1_rad_s", 0.0},    {"w2_rad_s", rate_rad_s * std::sin(theta)},
      {"w3_rad_s", spin},   {"x_m", 0.01},
      {"y_m", -0.02}};
  constexpr int kSamples = 24;
  const data::Track track = path_of(scene, truth, kSamples, 240.0);
  const ArcData seen =
      make_arc(track, 0, kSamples, {.position = true, .theta = true, .phi = true}, false);
  const double by_thickness = 2.0 * body.h * rate_rad_s * std::sin(theta) / body.R;
  for (const Start& start : rim_starts(seen, body, false))
    EXPECT_LT(std::abs(start.values.at("w3_rad_s") - spin), 0.2 * by_thickness);
}

// From positions alone the tilt is on a grid, and what spin goes with it follows from that.
TEST(RimStarts, OneSpinsAsFastAsTheVeeringOfThePathAsks) {
  const data::Scene scene = sliding_disc();
  constexpr int kSamples = 24;
  const data::Track track = path_of(scene, kSpinsInPlace, kSamples, 240.0);
  const std::vector<Start> starts =
      rim_starts(make_arc(track, 0, kSamples, {}, true), per_mass(scene), true);
  EXPECT_TRUE(std::any_of(starts.begin(), starts.end(), [&](const Start& start) {
    const auto off = [&](const char* name) {
      return start.values.at(name) - kSpinsInPlace.at(name);
    };
    return std::abs(off("theta_rad")) <= 0.076 && std::abs(off("w3_rad_s")) < 0.3 * 80.0 &&
           std::abs(std::remainder(off("phi_rad"), 2.0 * std::numbers::pi)) < 0.2;
  }));
}

// A centre that runs on a small circle does so ahead of the contact or behind it.
TEST(RimStarts, ALookAlikeRollsSteadilyTheSameWayLeaningTheOtherWay) {
  const model::RimBody body = per_mass(sliding_disc());
  constexpr double kTilt_rad = 1.2, kAzimuth_rad = 0.4, kRate_rad_s = 48.0;
  const double w2 = kRate_rad_s * std::sin(kTilt_rad);
  const double w3 = model::steady_rolling_spin(body, kTilt_rad, kRate_rad_s);
  const double along_m_s = body.h * w2 - body.R * w3;
  const Start known{"multistart",
                    {{"theta_rad", kTilt_rad},
                     {"phi_rad", kAzimuth_rad},
                     {"w1_rad_s", 0.0},
                     {"w2_rad_s", w2},
                     {"w3_rad_s", w3},
                     {"vx_m_s", along_m_s * std::cos(kAzimuth_rad)},
                     {"vy_m_s", along_m_s * std::sin(kAzimuth_rad)},
                     {"rolling_friction_m", 1e-5}}};
  ASSERT_LT(slip_of(known.values, body).norm(), 1e-12);
  const std::vector<Start> others = leaning_otherwise(body, known);
  ASSERT_FALSE(others.empty());
  constexpr double kRounding = 1e-9, kBisected = 1e-4;  // the tilt to 5e-8 rad
  constexpr double kAnother_rad = 0.05;  // the grid's step: not the known one found again
  for (const Start& other : others) {
    const std::map<std::string, double>& state = other.values;
    EXPECT_GT(std::abs(state.at("theta_rad") - kTilt_rad), kAnother_rad);
    EXPECT_NEAR(std::abs(state.at("phi_rad") - kAzimuth_rad), std::numbers::pi, kRounding);
    const double rate = state.at("w2_rad_s") / std::sin(state.at("theta_rad"));
    EXPECT_NEAR(rate, kRate_rad_s, kRounding);
    EXPECT_NEAR(state.at("w3_rad_s"), model::steady_rolling_spin(body, state.at("theta_rad"), rate),
                kBisected);
    EXPECT_LT(slip_of(state, body).norm(), kRounding);
    EXPECT_EQ(state.at("rolling_friction_m"), 1e-5);
  }
}

}  // namespace
}  // namespace trochoid::fitting
