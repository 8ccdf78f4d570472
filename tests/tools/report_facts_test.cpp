#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "report/parts.hpp"

namespace trochoid::tools {
namespace {

/// A path along x of ten samples, in pixels and, but for one of them, in metres.
ReportInput seen_in_metres_but_once() {
  ReportInput input;
  input.tracks.tracks.emplace_back();
  for (int i = 0; i < 10; ++i) {
    data::TrackSample sample;
    sample.frame = i;
    sample.t_s = 0.01 * i;
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

}  // namespace
}  // namespace trochoid::tools
