#include "common/recording_name.hpp"

#include <gtest/gtest.h>

namespace trochoid::tools {
namespace {

TEST(RecordingName, IsTheFilesOrOfManyPicturesTheirFolders) {
  EXPECT_EQ(recording_name("clips/ring.mp4"), "ring");
  EXPECT_EQ(recording_name("clips/ring"), "ring");
  EXPECT_EQ(recording_name("clips/ring/"), "ring");
  EXPECT_EQ(recording_name("clips/ring/*.png"), "ring");
  EXPECT_EQ(recording_name("clips/ring/%04d.png"), "ring");
  EXPECT_EQ(recording_name("clips/ring/[12]/f?.png"), "ring");
  EXPECT_EQ(recording_name("/*.png"), "pictures");
}

TEST(RecordingName, OfPicturesHereIsThisFoldersOwn) {
  EXPECT_EQ(recording_name("*.png"), std::filesystem::current_path().filename().string());
}

}  // namespace
}  // namespace trochoid::tools
