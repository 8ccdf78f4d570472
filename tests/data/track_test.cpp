#include "trochoid/data/track.hpp"

#include <gtest/gtest.h>

#include "trochoid/data/error.hpp"

namespace trochoid::data {
namespace {

TEST(Track, WithTimesThatDoNotIncreaseIsRefusedAndTheTwoTimesAreNamed) {
  Track track;
  track.samples.resize(2);
  track.samples[0].t_s = 0.25;
  track.samples[1].t_s = 0.20;
  try {
    check(track, "disc.csv");
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("0.2"), std::string::npos);
    EXPECT_NE(std::string(error.what()).find("0.25"), std::string::npos);
  }
}

}  // namespace
}  // namespace trochoid::data
