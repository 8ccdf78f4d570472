#include "link/path_outliers.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <utility>
#include <vector>

namespace trochoid::tracking {
namespace {

constexpr int kGlimpses = 30, kHitGlimpse = 15;
constexpr double kSigmaPx = 0.05;

// Centres along a bent path that breaks in frame kHitGlimpse: there the body strikes something.
struct Recorded {
  std::vector<Frame> frames{kGlimpses};
  std::vector<Glimpse> glimpses;

  Recorded() {
    for (int i = 0; i < kGlimpses; ++i) {
      Frame& frame = frames[static_cast<std::size_t>(i)];
      frame.index = i;
      frame.t_s = i / 100.0;
      Sighting& seen = glimpses.emplace_back(Glimpse{&frame}).seen.emplace();
      seen.rim = Ellipse::from_axes({0.0, 0.0}, 40.0, 30.0, 0.0);
      seen.accepted = 0.9;
      const double since = i - kHitGlimpse, jitter = 0.02 * (i % 3 - 1);
      const double y = since < 0 ? 0.03 * since * since : -6.0 * since + 0.03 * since * since;
      seen.centre_px = {100.0 + 4.0 * since + jitter, 80.0 + y};
      seen.covariance_px2 = kSigmaPx * kSigmaPx * Eigen::Matrix2d::Identity();
      PoseMeasurement& pose = seen.pose.emplace();
      pose.pose.centre_m = {1e-3 * seen.centre_px.x(), 1e-3 * seen.centre_px.y(), 0.0};
      pose.covariance_px2 = seen.covariance_px2;
      pose.covariance_m2 = 1e-6 * seen.covariance_px2;
    }
  }
};

std::vector<int> unseen(const std::vector<Glimpse>& glimpses) {
  std::vector<int> out;
  for (const Glimpse& g : glimpses)
    if (!g.seen) out.push_back(static_cast<int>(g.frame->index));
  return out;
}

std::vector<int> doubted(const std::vector<Glimpse>& glimpses) {
  std::vector<int> out;
  for (const Glimpse& g : glimpses)
    if (g.seen->attitude_doubtful) out.push_back(static_cast<int>(g.frame->index));
  return out;
}

TEST(PathOutliers, AnImpactIsNotDoubted) {
  Recorded recorded;
  doubt_what_leaves_the_path(recorded.glimpses);
  EXPECT_EQ(doubted(recorded.glimpses), std::vector<int>{});
}

TEST(PathOutliers, AFitThatWentAstrayIsDoubtedAndItsNeighboursAreNot) {
  Recorded recorded;
  Sighting& astray = *recorded.glimpses[7].seen;
  const Eigen::Vector2d off_px(1.5, -1.0);
  astray.centre_px += off_px;
  astray.pose->pose.centre_m.head<2>() += 1e-3 * off_px;
  const Eigen::Vector2d seen_px = astray.centre_px;
  doubt_what_leaves_the_path(recorded.glimpses);
  EXPECT_EQ(doubted(recorded.glimpses), std::vector<int>{7});
  EXPECT_EQ(astray.centre_px, seen_px);
  // The true place is well within two standard deviations then.
  EXPECT_LT(off_px.dot(astray.covariance_px2.inverse() * off_px), 2.0);
  const Eigen::Vector2d off_m = 1e-3 * off_px;
  EXPECT_LT(off_m.dot(astray.pose->covariance_m2.inverse() * off_m), 2.0);
}

TEST(PathOutliers, WhereTooFewFramesAreNearNothingIsDoubted) {
  Recorded recorded;
  std::vector<Glimpse> few{recorded.glimpses[0], recorded.glimpses[10], recorded.glimpses[20]};
  few[1].seen->centre_px.x() += 20.0;
  doubt_what_leaves_the_path(few);
  EXPECT_EQ(doubted(few), std::vector<int>{});
}

// Frames 4 to 9, seen so well and so far off the path.
std::vector<int> forgotten(double accepted, const Eigen::Vector2d& off_px) {
  Recorded recorded;
  for (std::size_t i = 4; i < 10; ++i) {
    recorded.glimpses[i].seen->accepted = accepted;
    recorded.glimpses[i].seen->centre_px += off_px;
  }
  forget_what_the_path_jumps_to(recorded.glimpses);
  return unseen(recorded.glimpses);
}

TEST(PathOutliers, WhatHidesTheBodyAndIsTakenForItIsForgotten) {
  EXPECT_EQ(forgotten(0.3, {25.0, -20.0}), (std::vector<int>{4, 5, 6, 7, 8, 9}));
}

TEST(PathOutliers, ABodyHalfHiddenOnItsPathIsKept) {
  EXPECT_EQ(forgotten(0.3, {0.5, -0.5}), std::vector<int>{});
}

TEST(PathOutliers, ABodyWellSeenIsKeptWhereverItIs) {
  EXPECT_EQ(forgotten(0.9, {25.0, -20.0}), std::vector<int>{});
}

// Frames 8 to 11 hidden; the support of frames 5 to 7 and 12 to 14, as a share of the usual.
std::vector<int> forgotten_beside_a_gap(double before, double after) {
  Recorded recorded;
  for (Glimpse& g : recorded.glimpses) g.seen->pose->support_px = 200.0;
  for (std::size_t i = 5; i < 8; ++i) recorded.glimpses[i].seen->pose->support_px *= before;
  for (std::size_t i = 12; i < 15; ++i) recorded.glimpses[i].seen->pose->support_px *= after;
  for (std::size_t i = 8; i < 12; ++i) recorded.glimpses[i].seen.reset();
  forget_weak_support_beside_gaps(recorded.glimpses);
  return unseen(recorded.glimpses);
}

TEST(PathOutliers, WhatIsSeenLittleBesideAGapIsForgottenOnEitherSide) {
  EXPECT_EQ(forgotten_beside_a_gap(0.3, 0.9), (std::vector<int>{5, 6, 7, 8, 9, 10, 11}));
  EXPECT_EQ(forgotten_beside_a_gap(0.9, 0.3), (std::vector<int>{8, 9, 10, 11, 12, 13, 14}));
}

TEST(PathOutliers, ABodySeenWellUpToAGapIsKept) {
  EXPECT_EQ(forgotten_beside_a_gap(0.8, 0.7), (std::vector<int>{8, 9, 10, 11}));
}

// No gap is near, or only the beginning of the recording.
TEST(PathOutliers, ABodySeenLittleWithoutAGapIsKept) {
  Recorded recorded;
  for (Glimpse& g : recorded.glimpses) g.seen->pose->support_px = 200.0;
  for (const std::size_t i : {0, 1, 2, 20, 21, 22})
    recorded.glimpses[i].seen->pose->support_px = 50.0;
  forget_weak_support_beside_gaps(recorded.glimpses);
  for (const Glimpse& g : recorded.glimpses) EXPECT_TRUE(g.seen) << "frame " << g.frame->index;
}

// A covariance that spans much of the body says that it is somewhere here.
TEST(PathOutliers, AWrongPlaceThatIsToldIsNoSighting) {
  Recorded recorded;
  recorded.glimpses[7].seen->covariance_px2 = 200.0 * Eigen::Matrix2d::Identity();
  forget_what_tells_nothing(recorded.glimpses);
  for (const Glimpse& g : recorded.glimpses) EXPECT_EQ(g.seen.has_value(), g.frame->index != 7);
}

// Frames 5 to 15 hidden but for frame 10.
TEST(PathOutliers, WhatIsSeenAloneInAGapIsDoubtedWhereTheLineAcrossTheGapDoesNotLead) {
  for (const double off_px : {0.0, 30.0}) {
    Recorded recorded;
    for (std::size_t i = 5; i <= 15; ++i)
      if (i != 10) recorded.glimpses[i].seen.reset();
    Sighting& lone = *recorded.glimpses[10].seen;
    const Eigen::Vector2d true_px = lone.centre_px;
    lone.centre_px.x() += off_px;
    doubt_what_stands_alone(recorded.glimpses);
    EXPECT_EQ(lone.attitude_doubtful, off_px > 0.0);
    if (off_px == 0.0) continue;
    const Eigen::Vector2d off = lone.centre_px - true_px;
    EXPECT_LT(off.dot(lone.covariance_px2.inverse() * off), 4.0) << "two standard deviations";
  }
}

}  // namespace
}  // namespace trochoid::tracking
