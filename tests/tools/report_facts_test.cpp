#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "report/parts.hpp"

namespace trochoid::tools {
namespace {

data::TrackSample sample_of_frame(int frame) {
  data::TrackSample sample;
  sample.frame = frame;
  sample.t_s = 0.01 * frame;
  return sample;
}

/// A path along x of ten samples, in pixels and, but for one of them, in metres.
ReportInput seen_in_metres_but_once() {
  ReportInput input;
  input.tracks.tracks.emplace_back();
  for (int i = 0; i < 10; ++i) {
    data::TrackSample sample = sample_of_frame(i);
    sample.centre_px = {700.0 + i, 500.0};
    if (i != 4) sample.centre_m = {0.001 * i, 0.0};
    input.tracks.tracks.front().samples.push_back(sample);
  }
  return input;
}

TEST(Report, OneSampleWithoutMetresDoesNotTurnTheOthersIntoPixels) {
  const ReportInput input = seen_in_metres_but_once();
  const ReportFacts facts = gather(input);
  EXPECT_TRUE(facts.metres);
  const std::string figure = path_figure(facts);
  EXPECT_THAT(figure, testing::HasSubstr("x [mm]"));
  EXPECT_THAT(figure, testing::Not(testing::HasSubstr("nan")));
}

// A puck that slides at 1 m/s with next to no friction, seen a micrometre off by turns.
ReportInput sliding_puck() {
  ReportInput input;
  input.tracks.tracks.emplace_back();
  for (int i = 0; i < 20; ++i) {
    data::TrackSample sample = sample_of_frame(i);
    sample.centre_m = {sample.t_s, i % 2 == 0 ? 1e-6 : -1e-6};
    sample.covariance_m2 = 1e-12 * Eigen::Matrix2d::Identity();
    input.tracks.tracks.front().samples.push_back(sample);
  }
  data::Fit fit;
  fit.model = "puck";
  fit.converged = true;
  fit.scene_toml =
      "[body]\nkind = \"disc\"\nradius_m = 0.03\nthickness_m = 0.006\nmass_kg = 0.05\n"
      "[support]\nkind = \"flat\"\n[model]\nname = \"puck\"\nfriction = 1e-9\n";
  fit.parameters.emplace_back();
  fit.parameters.front().name = "vx_m_s";
  fit.parameters.front().value = 1.0;
  fit.arcs = {{.track = 0, .object = 0, .from_s = 0.0, .to_s = 0.2, .samples = 20}};
  input.fit = fit;
  return input;
}

TEST(Report, APositionThatWasGivenUpIsCountedAndNotInTheScatter) {
  ReportInput input = sliding_puck();
  input.tracks.tracks.front().samples[7].centre_m.x() += 1.0;
  const ReportFacts facts = gather(input);
  EXPECT_EQ(facts.far_off, 1);
  // The other 19 are off across the path only.
  EXPECT_NEAR(facts.rms_axis_m, 1e-6 / std::sqrt(2.0), 1e-11);
  const std::string whole = judge(facts).sentence;
  EXPECT_THAT(whole, testing::HasSubstr("but for 1 far off"));
  EXPECT_THAT(whole, testing::StartsWith("The path of 20 positions over 0.19 s"));
  input.fit->arcs = {{.track = 0, .object = 0, .from_s = 0.05, .to_s = 0.15, .samples = 11}};
  EXPECT_THAT(judge(gather(input)).sentence,
              testing::StartsWith("The path of 11 of the 20 positions, over 0.1 s"));
}

TEST(Report, ThePredictionIsDrawnOverTheDotsThatItFollows) {
  const ReportInput input = sliding_puck();
  const nlohmann::json charts = series_of(gather(input))["objects"][0]["charts"];
  for (const nlohmann::json& chart : {charts[0], charts[1]}) {
    EXPECT_EQ(chart["series"].front()["label"], "observed");
    EXPECT_EQ(chart["series"].back()["label"], "predicted");
  }
}

TEST(Report, SaysFirstWhatTheTrackerNotedOfItsRecording) {
  ReportInput input = sliding_puck();
  input.tracks.notes = {"the camera moves"};
  input.fit->warnings = {"a warning"};
  EXPECT_THAT(judge(gather(input)).remarks, testing::ElementsAre("the camera moves", "a warning"));
}

TEST(Report, AFitFromWhosePathMostPositionsLieFarIsOfAnotherTrack) {
  ReportInput input = sliding_puck();
  for (data::TrackSample& sample : input.tracks.tracks.front().samples)
    if (sample.frame > 2) sample.centre_m.y() += 0.1;
  const Verdict verdict = judge(gather(input));
  EXPECT_EQ(verdict.grade, "bad");
  EXPECT_THAT(verdict.sentence, testing::StartsWith("17 of 20 positions lie far off the path"));
}

// Another body's positions, of which the fit knows nothing, do not make up for it.
TEST(Report, AFitOfOneOfSeveralBodiesIsJudgedByThatOne) {
  ReportInput input = sliding_puck();
  data::Track other = input.tracks.tracks.front();
  other.object = 1;
  for (data::TrackSample& sample : input.tracks.tracks.front().samples) sample.centre_m.y() += 0.1;
  input.tracks.tracks.push_back(other);
  const Verdict verdict = judge(gather(input));
  EXPECT_EQ(verdict.grade, "bad");
  EXPECT_THAT(verdict.sentence, testing::StartsWith("20 of 20 positions lie far off the path"));
}

}  // namespace
}  // namespace trochoid::tools
