#include "common/provenance.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "trochoid/data/error.hpp"

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

TEST(Provenance, OfAFitOfSeveralRecordingsTheUserSaysWhichOneIsMeant) {
  data::Fit fit;
  fit.arcs = {{.track = 0, .from_s = 0.0, .to_s = 1.0, .samples = 9},
              {.track = 1, .from_s = 0.0, .to_s = 1.0, .samples = 9}};
  data::TrackFile one, both;
  one.tracks.resize(1);
  both.tracks.resize(2);
  EXPECT_EQ(place_in_fit(fit, "both.fit.json", both, std::nullopt), 0) << "two bodies of one file";
  EXPECT_EQ(place_in_fit(fit, "both.fit.json", one, 1), 1);
  fit.arcs.back().track = 2;
  EXPECT_THROW(static_cast<void>(place_in_fit(fit, "three.fit.json", both, std::nullopt)),
               InputError);
  fit.arcs.back().track = 1;
  try {
    static_cast<void>(place_in_fit(fit, "both.fit.json", one, std::nullopt));
    FAIL() << "a track was picked";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::AllOf(testing::StartsWith("both.fit.json: "),
                                             testing::HasSubstr("--fit-track"),
                                             testing::HasSubstr("from 0 to 1")));
  }
}

}  // namespace
}  // namespace trochoid::tools
