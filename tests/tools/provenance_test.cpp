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

// Of two files of two bodies each, one of which --object 1 picked, the second is the fit's second
// track, though the first has as many bodies as the fit has tracks.
TEST(Provenance, OneBodyOfEachFileCountsAsOneTrack) {
  data::Fit fit;
  fit.arcs = {{.track = 0, .object = 1, .from_s = 0.0, .to_s = 1.0, .samples = 9},
              {.track = 1, .object = 1, .from_s = 0.0, .to_s = 1.0, .samples = 9}};
  data::TrackFile file;
  file.tracks = {{.object = 0, .samples = {}}, {.object = 1, .samples = {}}};
  EXPECT_EQ(tracks_fitted(fit, file), 1);
  EXPECT_THROW(static_cast<void>(place_in_fit(fit, "fit.json", file, std::nullopt)), InputError);
  EXPECT_EQ(place_in_fit(fit, "fit.json", file, 1), 1);
  file.tracks = {{.object = 7, .samples = {}}};
  EXPECT_EQ(tracks_fitted(fit, file), 1) << "of whatever number";
}

TEST(Provenance, APlaceThatAFitDoesNotHaveIsNamedWithTheFile) {
  data::Fit fit;
  fit.arcs = {{.track = 0, .from_s = 0.0, .to_s = 1.0, .samples = 9}};
  data::TrackFile file;
  file.tracks.resize(1);
  EXPECT_EQ(place_in_fit(fit, "ring.fit.json", file, 0), 0);
  try {
    static_cast<void>(place_in_fit(fit, "ring.fit.json", file, 9));
    FAIL() << "a place was made up";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::AllOf(testing::StartsWith("ring.fit.json: is of 1 track, "),
                                             testing::HasSubstr("--fit-track (fit_track) = 9")));
  }
}

}  // namespace
}  // namespace trochoid::tools
