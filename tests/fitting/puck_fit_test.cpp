#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <random>

#include "trochoid/data/error.hpp"
#include "trochoid/fitting/compare.hpp"
#include "trochoid/fitting/fit.hpp"
#include "trochoid/model/predictor.hpp"
#include "values_with.hpp"

// A flat puck that is thrown, hits something and comes to rest. Without spin Coulomb's law is a
// constant deceleration, so the truth here needs no integrator.
namespace trochoid::fitting {
namespace {

constexpr double kFriction = 0.2, kGravity_m_s2 = 9.81, kPuckSigma_m = 5e-5,
                 kPuckFrame_s = 1.0 / 240;

data::Scene puck_scene() {
  data::Scene scene;
  scene.body = data::Body{};
  scene.body->kind = data::BodyKind::disc;
  scene.body->radius_m = 0.0155;
  scene.body->thickness_m = 0.009;
  scene.support.kind = data::SupportKind::flat;
  scene.model.name = "puck";
  scene.model.friction = 0.1;
  return scene;
}

class Throw {
 public:
  explicit Throw(std::uint64_t seed) : generator_(seed) {}
  // Slides for that long from where it is, with this velocity; stops when friction has used it up.
  Throw& slide(const Eigen::Vector2d& velocity_m_s, double duration_s) {
    const double deceleration = friction_ * kGravity_m_s2, speed = velocity_m_s.norm();
    const Eigen::Vector2d from = at_;
    for (int i = 1; i <= std::lround(duration_s / kPuckFrame_s); ++i) {
      const double t = kPuckFrame_s * i;
      const double moving = std::min(t, speed > 0.0 ? speed / deceleration : 0.0);
      if (speed > 0.0)
        at_ = from + velocity_m_s / speed * (speed * moving - 0.5 * deceleration * moving * moving);
      add();
    }
    return *this;
  }
  Throw& with_friction(double friction) {
    friction_ = friction;
    return *this;
  }
  // A hand speeds it up.
  Throw& push(const Eigen::Vector2d& acceleration_m_s2, double duration_s) {
    const Eigen::Vector2d from = at_;
    for (int i = 1; i <= std::lround(duration_s / kPuckFrame_s); ++i) {
      const double t = kPuckFrame_s * i;
      at_ = from + 0.5 * acceleration_m_s2 * t * t;
      add();
    }
    return *this;
  }
  [[nodiscard]] const data::Track& track() const { return track_; }

 private:
  void add() {
    data::TrackSample sample;
    sample.t_s = kPuckFrame_s * static_cast<double>(track_.samples.size());
    sample.centre_m = at_ + Eigen::Vector2d{normal_(generator_), normal_(generator_)};
    sample.covariance_m2 = Eigen::Matrix2d::Identity() * kPuckSigma_m * kPuckSigma_m;
    track_.samples.push_back(sample);
  }
  double friction_ = kFriction;
  std::mt19937_64 generator_;
  std::normal_distribution<double> normal_{0.0, kPuckSigma_m};
  Eigen::Vector2d at_ = Eigen::Vector2d::Zero();
  data::Track track_;
};

TEST(PuckFit, DividesTheTrackAtImpactAndRest) {
  Throw thrown(1);
  thrown.slide({0.0, 0.0}, 0.2).slide({1.0, 0.3}, 0.3).slide({-0.2, 0.5}, 0.6);
  const data::Fit fit = fitting::fit(std::span(&thrown.track(), 1), puck_scene());
  ASSERT_TRUE(fit.converged) << fit.reason;
  ASSERT_EQ(fit.arcs.size(), 2u);
  // The cut itself may lie a frame or two early, and a sample on either side of it is left out.
  constexpr double kFewFrames_s = 4.0 * kPuckFrame_s;
  EXPECT_NEAR(fit.arcs[0].from_s, 0.2, kFewFrames_s);
  EXPECT_NEAR(fit.arcs[0].to_s, 0.5, kFewFrames_s);
  EXPECT_NEAR(fit.arcs[1].from_s, 0.5, kFewFrames_s);
  const data::FitParameter* friction = fit.find("friction");
  EXPECT_LT(std::abs(friction->value - kFriction), 4.0 * friction->sigma);
  EXPECT_LT(friction->sigma, 0.01 * kFriction);
}

// A tracker's slip of 40 sigma was taken for two impacts, with a stretch of six samples in between.
TEST(PuckFit, DividesNoTrackAtSamplesThatTheTrackerMissed) {
  Throw thrown(1);
  thrown.slide({1.0, 0.3}, 0.3).slide({-0.2, 0.5}, 0.6);
  data::Track track = thrown.track();
  const data::Fit clean = fitting::fit(std::span(&track, 1), puck_scene());
  for (const std::size_t i : {20U, 45U, 47U, 90U})
    track.samples[i].centre_m.y() += 40.0 * kPuckSigma_m;
  const data::Fit fit = fitting::fit(std::span(&track, 1), puck_scene());
  ASSERT_EQ(fit.arcs.size(), clean.arcs.size());
  for (std::size_t i = 0; i < fit.arcs.size(); ++i) {
    EXPECT_NEAR(fit.arcs[i].from_s, clean.arcs[i].from_s, 2.0 * kPuckFrame_s);
    EXPECT_NEAR(fit.arcs[i].to_s, clean.arcs[i].to_s, 2.0 * kPuckFrame_s);
  }
  const data::FitParameter &friction = *fit.find("friction"), &of_clean = *clean.find("friction");
  EXPECT_LT(std::abs(friction.value - kFriction), 4.0 * friction.sigma);
  EXPECT_LT(friction.sigma, 1.2 * of_clean.sigma);
}

// "The last positions of track 1" were those before an impact in its middle.
TEST(PuckFit, SaysOfWhichStretchItMissesTheEnd) {
  Throw thrown(4);
  thrown.slide({0.0, 0.0}, 0.2).slide({1.0, 0.3}, 0.3).slide({-0.2, 0.5}, 0.6);
  data::Track track = thrown.track();
  constexpr double kOff = 5.0;  // sigma; of more of them, or farther ones, another stretch is made
  for (std::size_t i = 114; i < 117; ++i) track.samples[i].centre_m.y() += kOff * kPuckSigma_m;
  const data::Fit fit = fitting::fit(std::span(&track, 1), puck_scene());
  ASSERT_EQ(fit.arcs.size(), 2u);
  EXPECT_THAT(fit.warnings,
              testing::Contains(testing::HasSubstr("last positions of the stretch from 0.2")));
}

// Each stretch was as noisy as its own few samples made believe: of seven between two impacts most
// were "left out of the fit", and the model did not explain the track.
TEST(PuckFit, TakesStretchesOfOneRecordingForEquallyNoisy) {
  constexpr double kNoise_m = 3e-4;
  for (const std::uint64_t seed : {1U, 2U, 3U, 4U}) {
    Throw thrown(seed);
    thrown.slide({0.9, 0.3}, 0.3).slide({-0.2, 0.7}, 0.042).slide({0.6, -0.4}, 0.25);
    data::Track track = thrown.track();
    std::mt19937_64 generator(seed);
    std::normal_distribution<double> normal(0.0, kNoise_m);
    for (data::TrackSample& sample : track.samples) {
      sample.centre_m += Eigen::Vector2d{normal(generator), normal(generator)};
      sample.covariance_m2.setConstant(std::numeric_limits<double>::quiet_NaN());
    }
    const data::Fit fit = fitting::fit(std::span(&track, 1), puck_scene());
    EXPECT_EQ(fit.arcs.size(), 3u);
    EXPECT_THAT(fit.verdict,
                testing::AnyOf(data::FitVerdict::good, data::FitVerdict::good_correlated))
        << seed << ": " << fit.verdict_words;
  }
}

TEST(PuckFit, SaysWhichTrackCountsForNothing) {
  Throw thrown(6), resting(7);
  thrown.slide({1.0, 0.3}, 0.3);
  resting.slide({0.0, 0.0}, 0.3);
  const std::vector<data::Track> tracks{resting.track(), thrown.track()};
  const data::Fit fit = fitting::fit(tracks, puck_scene());
  ASSERT_TRUE(fit.converged) << fit.reason;
  EXPECT_THAT(fit.warnings, testing::Contains(testing::HasSubstr("track 1 counts for nothing")));
}

TEST(PuckFit, SaysWhetherOneFrictionExplainsAllArcs) {
  Throw thrown(5);
  thrown.slide({1.0, 0.3}, 0.3).slide({-0.2, 0.6}, 0.2).slide({0.7, -0.4}, 0.3);
  const data::Fit same = fitting::fit(std::span(&thrown.track(), 1), puck_scene());
  ASSERT_EQ(same.arcs.size(), 3u);
  EXPECT_THAT(
      same.warnings,
      testing::Contains(testing::HasSubstr("one friction coefficient explains the 3 arcs")));
  Throw other(6);
  other.slide({1.0, 0.3}, 0.3).with_friction(0.3).slide({-0.2, 0.9}, 0.25);
  const data::Fit two = fitting::fit(std::span(&other.track(), 1), puck_scene());
  EXPECT_THAT(two.warnings, testing::Contains(testing::HasSubstr("does not explain")));
  // The common value is no better known than the arcs agree.
  const data::FitParameter* common = two.find("friction");
  for (const double own : {kFriction, 0.3})
    EXPECT_LT(std::abs(common->value - own), 4.0 * common->sigma);
}

// "object 0" had been said of each.
TEST(PuckFit, NamesTheTracksWhoseFrictionsAreCompared) {
  Throw first(5), second(6);
  first.slide({1.0, 0.3}, 0.3);
  second.slide({0.7, -0.4}, 0.3);
  const std::vector<data::Track> tracks{first.track(), second.track()};
  EXPECT_THAT(fitting::fit(tracks, puck_scene()).warnings,
              testing::Contains(testing::AllOf(testing::HasSubstr("(track 1, 0 to"),
                                               testing::HasSubstr("(track 2, 0 to"))));
}

// Alone, an arc counted a sample that the fit had given up in full, and leaned on what was known of
// the friction as much as all of them together did.
TEST(PuckFit, AsksTheArcsAloneWhetherOneFrictionExplainsThem) {
  Throw thrown(5);
  thrown.slide({1.0, 0.3}, 0.3).slide({-0.2, 0.6}, 0.2).slide({0.7, -0.4}, 0.3);
  const auto explains = testing::Contains(testing::HasSubstr("coefficient explains the 3 arcs"));
  data::Track missed = thrown.track();
  missed.samples[80].centre_m += 400.0 * kPuckSigma_m * Eigen::Vector2d(-0.3, 0.9);
  EXPECT_THAT(fitting::fit(std::span(&missed, 1), puck_scene()).warnings, explains);
  data::Scene misled = puck_scene();
  misled.fit.prior["friction"] = {0.21, 0.0005};
  EXPECT_THAT(fitting::fit(std::span(&thrown.track(), 1), misled).warnings, explains);
}

double held_back_of_chosen(const data::Track& track) {
  for (const data::ModelScore& row : compare(std::span(&track, 1), puck_scene(), {}).fit.comparison)
    if (row.recommended) return row.held_back_rms_sigma;
  return std::numeric_limits<double>::quiet_NaN();
}

// The right model missed the last third by hundreds of sigmas where the puck was hit in it, and by
// as much as a single wrong place weighs among the others.
TEST(PuckFit, PredictsOfWhatIsHeldBackTheStretchItFollows) {
  constexpr double kAsNoise = 2.0;
  Throw hit(8), free(9);
  hit.slide({1.4, 0.3}, 0.5).slide({-0.2, 0.6}, 0.1);
  EXPECT_LT(held_back_of_chosen(hit.track()), kAsNoise);
  free.slide({1.4, 0.3}, 0.5);
  data::Track missed = free.track();
  missed.samples[100].centre_m.y() += 400.0 * kPuckSigma_m;
  EXPECT_LT(held_back_of_chosen(missed), kAsNoise);
}

TEST(PuckFit, LeavesOutWhatAHandDoes) {
  Throw thrown(2);
  thrown.push({6.0, 0.0}, 0.15).slide({0.9, 0.0}, 0.3);
  const data::Fit fit = fitting::fit(std::span(&thrown.track(), 1), puck_scene());
  ASSERT_EQ(fit.arcs.size(), 1u);
  EXPECT_GT(fit.arcs[0].from_s, 0.14);
  EXPECT_LT(std::abs(fit.find("friction")->value - kFriction), 4.0 * fit.find("friction")->sigma);
}

// mu = deceleration / g grows with the scale and with the square of the frame rate.
TEST(PuckFit, CarriesScaleAndFrameRateIntoTheFriction) {
  Throw thrown(4);
  thrown.slide({1.0, 0.3}, 0.4);
  data::Scene scene = puck_scene();
  const data::Fit alone = fitting::fit(std::span(&thrown.track(), 1), scene);
  scene.fit.prior["radius_m"] = {0.0155, 0.02 * 0.0155};
  scene.fit.prior["frame_rate_hz"] = {240.0, 0.01 * 240.0};
  scene.camera.frame_rate_hz = 240.0;
  const data::Fit fit = fitting::fit(std::span(&thrown.track(), 1), scene);
  ASSERT_TRUE(fit.converged) << fit.reason;
  const double inner = alone.find("friction")->sigma;
  const double expected = std::hypot(inner, 0.02 * kFriction, 2.0 * 0.01 * kFriction);
  EXPECT_NEAR(fit.find("friction")->sigma, expected, 0.1 * expected);
  EXPECT_NEAR(fit.find("friction")->value, kFriction, 4.0 * inner);
  EXPECT_NE(fit.find("friction")->note.find("between clips"), std::string::npos);
}

// Up a slope a straight path is that of a puck with more friction; who says how well the floor is
// levelled gets that into the error bar, and slides to and fro see the slope themselves.
TEST(PuckFit, SaysWhatASlopeAlongThePathWouldBeOfTheFriction) {
  constexpr double kRise = 0.0017;  // 0.1 degrees
  const auto says = testing::Contains(testing::HasSubstr("taken for level"));
  const auto friction_of = [](const data::Track& track, const data::Scene& scene) {
    const data::Fit fit = fitting::fit(std::span(&track, 1), scene);
    return std::pair(*fit.find("friction"), fit.warnings);
  };
  Throw up(14), to_and_fro(15);
  up.with_friction(kFriction + kRise).slide({1.0, 0.0}, 0.4);
  to_and_fro.with_friction(kFriction + kRise).slide({1.0, 0.0}, 0.4);
  to_and_fro.with_friction(kFriction - kRise).slide({-1.0, 0.0}, 0.4);
  data::Scene scene = puck_scene();
  scene.fit.fixed["w3_rad_s"] = 0.0;
  const auto [level, warnings] = friction_of(up.track(), scene);
  EXPECT_GT(level.value - kFriction, 4.0 * level.sigma) << "else it tests nothing";
  EXPECT_THAT(warnings, testing::Contains(testing::HasSubstr("acts as 0.0017 of friction")));
  scene.fit.prior["slope_x"] = scene.fit.prior["slope_y"] = {0.0, kRise};
  const auto [allowed, less] = friction_of(up.track(), scene);
  EXPECT_NEAR(allowed.sigma, std::hypot(level.sigma, kRise), 0.1 * kRise);
  EXPECT_THAT(less, testing::Not(says));
  const auto [both, none] = friction_of(to_and_fro.track(), scene);
  EXPECT_LT(both.sigma, 0.5 * kRise);
  EXPECT_NEAR(both.value, kFriction, 4.0 * both.sigma);
}

// Sixteen residuals less five parameters: the noise is known to a fifth, and two sigmas by the
// normal distribution's quantile would hold 92.4 %.
TEST(PuckFit, KeepsItsPromiseWithFewSamples) {
  constexpr int kDraws = 2000;
  constexpr double kTolerance = 0.015;  // 3 standard deviations of the count
  int inside = 0, fitted = 0;
  data::Scene scene = puck_scene();
  scene.fit.fixed["w3_rad_s"] = 0.0;  // known not to turn
  for (int i = 0; i < kDraws; ++i) {
    Throw thrown(1000 + i);
    thrown.slide({1.0, 0.3}, 8.0 * kPuckFrame_s);
    const data::Fit fit = fitting::fit(std::span(&thrown.track(), 1), scene);
    const data::FitParameter* friction = fit.find("friction");
    if (friction == nullptr) continue;
    ++fitted;
    inside += std::abs(friction->value - kFriction) < 1.96 * friction->sigma;
  }
  ASSERT_GT(fitted, 0.99 * kDraws);
  EXPECT_NEAR(static_cast<double>(inside) / fitted, 0.95, kTolerance);
}

// Without spin nothing tells how far inside the rim a crowned face rests: somewhere within it.
TEST(PuckFit, DoesNotMeasureAContactRadiusThatNothingShows) {
  data::Track track = Throw(11).slide({0.9, 0.2}, 0.4).track();
  std::mt19937_64 generator(12);
  std::normal_distribution<double> normal(0.0, 0.01);
  for (data::TrackSample& sample : track.samples)
    sample.psi = data::MeasuredAngle{0.3 + normal(generator), 0.01};
  const data::Scene scene = puck_scene();
  const data::Fit result = fit(std::span(&track, 1), scene);
  ASSERT_TRUE(result.converged) << result.reason;
  const data::FitParameter* contact = result.find("contact_radius_m");
  ASSERT_NE(contact, nullptr);
  EXPECT_EQ(contact->status, data::ParameterStatus::prior);
  EXPECT_NEAR(contact->sigma, 0.5 * scene.body->radius_m, 0.1 * scene.body->radius_m);
  for (const auto& [name, truth] : {std::pair{"friction", kFriction}, {"w3_rad_s", 0.0}})
    EXPECT_NEAR(result.find(name)->value, truth, 4.0 * result.find(name)->sigma) << name;
}

// Goes on from the track's end as the model does from these values, its spin angle seen or not.
struct Turning {
  data::Scene scene = puck_scene();
  data::Track track = {};
  std::mt19937_64 generator;

  Turning& slide(std::map<std::string, double> values, int samples) {
    values.insert({"friction", kFriction});
    for (const auto& [name, at] : {std::pair{"x_m", at_m.x()}, {"y_m", at_m.y()}})
      values.insert({name, at});
    const auto predictor = model::make_predictor(scene);
    std::vector<double> t_s;
    for (int i = 0; i <= samples; ++i) t_s.push_back(i * kPuckFrame_s);
    model::PredictRequest request;
    request.t_s = t_s;
    request.observables.push_back(model::Observable::psi_rad);
    const Eigen::VectorXd run =
        predictor->predict(fitting::values_with(*predictor, values), request).values;
    std::normal_distribution<double> normal;
    for (int i = 0; i < samples; ++i) {
      const Eigen::Vector3d at = run.segment<3>(3 * i);
      data::TrackSample sample;
      sample.t_s = kPuckFrame_s * static_cast<double>(track.samples.size());
      sample.centre_m =
          at.head<2>() + kPuckSigma_m * Eigen::Vector2d{normal(generator), normal(generator)};
      sample.covariance_m2 = Eigen::Matrix2d::Identity() * kPuckSigma_m * kPuckSigma_m;
      sample.psi = data::MeasuredAngle{at[2] + 0.02 * normal(generator), 0.02};
      track.samples.push_back(sample);
    }
    at_m = run.segment<2>(3 * samples);
    return *this;
  }
  Turning& blind() {
    for (data::TrackSample& sample : track.samples) sample.psi.reset();
    return *this;
  }
  // That of a rim so many times as fast as the puck slides.
  [[nodiscard]] double spin_rad_s(double times, double speed_m_s) const {
    return times * speed_m_s / scene.body->radius_m;
  }
  Eigen::Vector2d at_m = Eigen::Vector2d::Zero();
};

// A rim one and a half times as fast as the puck slides takes a good part of the friction off its
// path, which bends the slowing down by little: the error bar has to allow for it, the more the
// less of that bend is seen.
TEST(PuckFit, AllowsForASpinThatNothingShows) {
  Turning turning{.generator = std::mt19937_64(8)};
  data::Scene scene = turning.scene;
  const double spin_rad_s = turning.spin_rad_s(1.5, 0.8);
  data::Track track = turning.slide({{"vx_m_s", 0.8}, {"w3_rad_s", spin_rad_s}}, 24).track;
  const data::FitParameter marked = *fit(std::span(&track, 1), scene).find("friction");
  for (data::TrackSample& sample : track.samples) sample.psi.reset();
  const data::Fit blind = fit(std::span(&track, 1), scene);
  scene.fit.prior["w3_rad_s"] = {spin_rad_s, 1.0};
  const data::Fit told = fit(std::span(&track, 1), scene);
  scene.fit.prior.clear();
  scene.fit.fixed["w3_rad_s"] = 0.0;
  const data::FitParameter trusting = *fit(std::span(&track, 1), scene).find("friction");
  const data::FitParameter* friction = blind.find("friction");
  EXPECT_THAT(blind.warnings, testing::Contains(testing::HasSubstr("puck's spin")));
  EXPECT_LT(std::abs(marked.value - kFriction), 4.0 * marked.sigma);
  EXPECT_LT(std::abs(friction->value - kFriction), 4.0 * friction->sigma);
  EXPECT_GT(std::abs(trusting.value - kFriction), 4.0 * trusting.sigma) << "else it tests nothing";
  // Who knows the spin otherwise gets the friction as well as from a mark, or nearly so.
  ASSERT_NE(told.find("w3_rad_s"), nullptr);
  EXPECT_EQ(told.find("w3_rad_s")->status, data::ParameterStatus::prior);
  EXPECT_LT(std::abs(told.find("friction")->value - kFriction), 4.0 * told.find("friction")->sigma);
  EXPECT_LT(told.find("friction")->sigma, 0.5 * friction->sigma);
}

// Of one recording alone: that of the other stays unknown.
TEST(PuckFit, TakesAPriorOnTheSpinOfOneArc) {
  Turning turning{.generator = std::mt19937_64(8)};
  const double spin_rad_s = turning.spin_rad_s(1.0, 0.8);
  data::Track track = turning.slide({{"vx_m_s", 0.8}, {"w3_rad_s", spin_rad_s}}, 24).track;
  for (data::TrackSample& sample : track.samples) sample.psi.reset();
  data::Scene scene = turning.scene;
  scene.fit.prior["w3_rad_s@1"] = {spin_rad_s, 1.0};
  data::Track beside = track;
  for (data::TrackSample& sample : beside.samples) sample.centre_m.y() += 0.1;
  const data::Fit two = fit(std::vector{track, beside}, scene);
  ASSERT_NE(two.find("w3_rad_s@1"), nullptr);
  EXPECT_EQ(two.find("w3_rad_s@1")->status, data::ParameterStatus::prior);
  EXPECT_EQ(two.find("w3_rad_s"), nullptr);
}

// After every impact it turns as it likes: what one common amount of spin would do to the path is
// ruled out, what each arc's own does is not.
TEST(PuckFit, AllowsForASpinOfEachArcsOwn) {
  Turning turning{.generator = std::mt19937_64(9)};
  const auto slide = [&](double vx, double vy, double times, int samples) {
    const double w3 = turning.spin_rad_s(times, std::hypot(vx, vy));
    turning.slide({{"vx_m_s", vx}, {"vy_m_s", vy}, {"w3_rad_s", w3}}, samples);
  };
  slide(0.7, -0.8, 0.9, 30);
  slide(-0.1, -0.8, -0.2, 30);
  slide(-0.8, 0.1, 0.7, 30);
  slide(-1.2, 0.4, 0.0, 100);
  const data::Fit result = fit(std::span(&turning.blind().track, 1), turning.scene);
  ASSERT_TRUE(result.converged) << result.reason;
  ASSERT_EQ(result.arcs.size(), 4u);
  for (const auto& [name, truth] :
       {std::pair{"friction", kFriction}, {"vx_m_s", 0.7}, {"vy_m_s", -0.8}})
    EXPECT_NEAR(result.find(name)->value, truth, 4.0 * result.find(name)->sigma) << name;
}

// Spin takes friction off the path, less and less as the puck slows down at first: alike to what
// air does, and far likelier.
TEST(PuckFit, DoesNotTakeASpinForTheAir) {
  Turning turning{.generator = std::mt19937_64(10)};
  turning.scene.body->mass_kg = 0.02;
  const double spin_rad_s = turning.spin_rad_s(-0.8, 0.9);
  turning.slide({{"vx_m_s", 0.9}, {"w3_rad_s", spin_rad_s}}, 100).blind();
  const Comparison chosen = compare(std::span(&turning.track, 1), turning.scene, {});
  ASSERT_TRUE(chosen.fit.converged) << chosen.fit.reason;
  const data::FitParameter* friction = chosen.fit.find("friction");
  EXPECT_LT(std::abs(friction->value - kFriction), 4.0 * friction->sigma);
  EXPECT_LT(friction->sigma, 0.1 * kFriction);
  // Which way round the path does not show.
  const data::FitParameter* spin = chosen.fit.find("w3_rad_s");
  ASSERT_NE(spin, nullptr);
  EXPECT_NEAR(std::abs(spin->value), std::abs(spin_rad_s), 0.2 * std::abs(spin_rad_s));
  EXPECT_LT(std::abs(spin->value - spin_rad_s), 3.0 * spin->sigma);
  EXPECT_THAT(chosen.fit.warnings, testing::Contains(testing::HasSubstr("which way round")));
}

// Half of what such a spin bends the path by was taken for friction, without a word of it.
TEST(PuckFit, TakesNoFirstValueOfASpinThatNothingShowsForTrue) {
  Turning turning{.generator = std::mt19937_64(13)};
  turning.slide({{"vx_m_s", 0.8}}, 100).blind();
  const double plain = fit(std::span(&turning.track, 1), turning.scene).find("friction")->value;
  turning.scene.start.w3_rad_s = turning.spin_rad_s(1.0, 0.8);
  const data::Fit result = fit(std::span(&turning.track, 1), turning.scene);
  EXPECT_DOUBLE_EQ(result.find("friction")->value, plain);
}

// What the data show and a prior tells as well is one parameter, not two.
TEST(PuckFit, APriorOnTheAngleOfAMarkCountsBesideTheMark) {
  Turning turning{.generator = std::mt19937_64(12)};
  turning.slide({{"vx_m_s", 0.9}, {"w3_rad_s", 40.0}, {"psi_rad", 0.2}}, 60);
  turning.scene.fit.prior["psi_rad"] = {0.0, 1.0};
  const data::Fit result = fit(std::span(&turning.track, 1), turning.scene);
  ASSERT_TRUE(result.converged) << result.reason;
  for (const auto& [name, truth] :
       {std::pair{"friction", kFriction}, {"psi_rad", 0.2}, {"w3_rad_s", 40.0}})
    EXPECT_NEAR(result.find(name)->value, truth, 4.0 * result.find(name)->sigma) << name;
}

TEST(PuckFit, RefusesABodyAtRest) {
  Throw thrown(3);
  thrown.slide({0.0, 0.0}, 1.0);
  EXPECT_THROW((void)fitting::fit(std::span(&thrown.track(), 1), puck_scene()), InputError);
}

// A first value is no more than that, however far below.
TEST(PuckFit, FindsTheContactFromAnyFirstValue) {
  constexpr double kContact_m = 0.012;
  Turning puck;
  puck.slide({{"vx_m_s", 0.8}, {"w3_rad_s", 60.0}, {"contact_radius_m", kContact_m}}, 60);
  for (const double first_m : {0.002, 0.015}) {
    puck.scene.model.contact_radius_m = first_m;
    const data::Fit result = fitting::fit(std::span(&puck.track, 1), puck.scene);
    ASSERT_TRUE(result.converged) << result.reason;
    for (const auto& [name, truth] :
         {std::pair{"contact_radius_m", kContact_m}, {"friction", kFriction}})
      EXPECT_LT(std::abs(result.find(name)->value - truth), 4.0 * result.find(name)->sigma) << name;
  }
}

}  // namespace
}  // namespace trochoid::fitting
