#ifdef TROCHOID_HAS_TRACKING
#include "common/track_options.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/not_good.hpp"

namespace trochoid::tools {
namespace {

data::Track track(int object, std::initializer_list<double> qualities) {
  data::Track track;
  track.object = object;
  for (const double quality : qualities) {
    track.samples.emplace_back();
    track.samples.back().quality = quality;
  }
  return track;
}

std::string complaint(std::vector<data::Track> tracks, int wanted) {
  data::TrackFile file;
  file.tracks = std::move(tracks);
  try {
    check_found(file, wanted);
  } catch (const NotGood& answer) {
    return answer.what();
  }
  return {};
}

TEST(CheckFound, AsksForOneFrameOfEachBodyThatIsNotDoubtful) {
  EXPECT_EQ(complaint({track(0, {0.1, 0.9, 0.1})}, 1), "");
  EXPECT_THAT(complaint({track(0, {0.1, 0.4})}, 1),
              testing::StartsWith("all 2 frames with the body are doubtful: "));
  EXPECT_THAT(complaint({track(0, {0.9}), track(1, {0.1})}, 2),
              testing::StartsWith("object 1: the only frame with the body is doubtful: "));
  EXPECT_EQ(complaint({track(0, {0.9})}, 2), "only 1 of 2 moving bodies found");
}

}  // namespace
}  // namespace trochoid::tools
#endif
