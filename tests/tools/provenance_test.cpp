#include "common/provenance.hpp"

#include <gtest/gtest.h>

namespace trochoid::tools {
namespace {

TEST(Provenance, RecordingsOfOneNameAreKeptApart) {
  Checksums inputs;
  add_recording(inputs, "ring.mp4", "1", "a/ring.track.csv");
  add_recording(inputs, "ring.mp4", "2", "b/ring.track.csv");
  add_recording(inputs, "ring.mp4", "1", "c/ring.track.csv");  // two bodies of one recording
  add_recording(inputs, "", "", "bare.csv");
  EXPECT_EQ(inputs, (Checksums{{"ring.mp4", "1"}, {"source of b/ring.track.csv", "2"}}));
}

}  // namespace
}  // namespace trochoid::tools
