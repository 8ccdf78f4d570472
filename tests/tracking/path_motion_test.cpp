#include "link/path_motion.hpp"

#include <gtest/gtest.h>

namespace trochoid::tracking {
namespace {

// All frames together may deny what each of them showed.
TEST(PathMotion, APathWithoutFramesDoesNotMoveNorExplainAnything) {
  const BodyPath path;
  EXPECT_FALSE(moves(path));
  EXPECT_EQ(travel_in_radii(path), 0.0);
  EXPECT_EQ(changes_explained(path, cv::Mat(20, 30, CV_8U, cv::Scalar(255))), 0);
}

}  // namespace
}  // namespace trochoid::tracking
