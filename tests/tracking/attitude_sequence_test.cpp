#include "link/attitude_sequence.hpp"

#include <Eigen/Geometry>

#include "glimpsed_sequence.hpp"
#include "trochoid/data/pose_motion.hpp"

namespace trochoid::tracking {
namespace {

class AttitudeSequence : public GlimpsedSequence {
 protected:
  void decide(const Oracle& oracle, std::vector<Glimpse>& glimpses) const {
    doubt_attitudes(decide_attitudes(background_, oracle, glimpses), glimpses);
  }
};

TEST_F(AttitudeSequence, AStretchThatFlippedIsTurnedBackByWhatTheRestSays) {
  const Oracle oracle([](int) { return 10.0; });
  auto glimpses = tracked(oracle, [](int i) { return i >= 20 && i < 40; });
  ASSERT_EQ(count_wrong(glimpses), 20);
  decide(oracle, glimpses);
  EXPECT_EQ(count_wrong(glimpses), 0);
}

TEST_F(AttitudeSequence, FramesThatSpeakForTheMirrorImageAreOverruled) {
  const Oracle oracle([](int i) { return i % 5 == 0 ? -10.0 : 10.0; });
  auto glimpses = tracked(oracle, [](int) { return false; });
  decide(oracle, glimpses);
  // The first and the last frame have neighbours on one side only.
  EXPECT_LE(count_wrong(glimpses), 1);
}

// Pictures of nearly the same attitude err alike: many of them are few witnesses against a jump
// of the axis by more than a radian.
TEST_F(AttitudeSequence, AStretchThatErrsAlikeDoesNotOutweighTheJumpItTakes) {
  constexpr int kErring = 25;
  const Oracle oracle([](int i) { return i < kErring ? -10.0 : 10.0; });
  auto glimpses = tracked(oracle, [](int i) { return i < kErring; });
  ASSERT_EQ(count_wrong(glimpses), kErring);
  decide(oracle, glimpses);
  EXPECT_EQ(count_wrong(glimpses), 0);
}

// A body that turns by most of a radian from frame to frame is seen anew each time, and frames that
// err are as many witnesses: it would still have to leap by another radian, and back.
TEST_F(AttitudeSequence, FramesThatSeeTheBodyAnewAndErrDoNotOutweighTheLeapTheyTake) {
  for (Frame& frame : frames_) frame.t_s *= 6.0;
  const Oracle oracle([](int i) { return i >= 20 && i < 38 ? -20.0 : 20.0; });
  auto glimpses = tracked(oracle, [](int) { return false; });
  decide(oracle, glimpses);
  EXPECT_EQ(count_wrong(glimpses), 0);
}

TEST_F(AttitudeSequence, WhatNothingTellsIsDoubtful) {
  const Oracle oracle([](int) { return 0.0; });
  auto glimpses = tracked(oracle, [](int) { return false; });
  decide(oracle, glimpses);
  for (const Glimpse& g : glimpses) {
    EXPECT_TRUE(g.seen->attitude_doubtful);
    EXPECT_TRUE(std::isinf(g.seen->pose->sigma_phi_rad));
  }
}

TEST_F(AttitudeSequence, OneOrTwoFramesAloneDoNotTell) {
  const Oracle oracle([](int) { return 10.0; });
  for (const std::size_t frames : {0u, 1u, 2u}) {
    auto glimpses = tracked(oracle, [](int) { return false; });
    glimpses.resize(frames);
    decide(oracle, glimpses);
    for (const Glimpse& g : glimpses) EXPECT_TRUE(g.seen->attitude_doubtful) << frames;
  }
}

// What measures once more with all that neighbours tell comes before the doubts.
TEST_F(AttitudeSequence, DoubtsAreToldBeforeAnyFrameIsMarkedWithThem) {
  const Oracle oracle([](int) { return 0.0; });
  auto glimpses = tracked(oracle, [](int) { return false; });
  const auto doubts = decide_attitudes(background_, oracle, glimpses);
  EXPECT_EQ(doubts.size(), glimpses.size());
  for (const Glimpse& g : glimpses) EXPECT_FALSE(g.seen->attitude_doubtful);
}

// Of a body turned over, the middle may be at either of two places.
TEST_F(AttitudeSequence, TheCovarianceOfADoubtedFrameHoldsBothPlaces) {
  const Oracle oracle([](int) { return 10.0; });
  auto glimpses = tracked(oracle, [](int) { return false; });
  const double before = glimpses[3].seen->pose->covariance_m2(0, 0);
  doubt_attitudes({{.at = 3, .off_px = {2.0, 0.0}, .off_m = {0.002, 0.0}}}, glimpses);
  EXPECT_NEAR(glimpses[3].seen->pose->covariance_m2(0, 0), before + 0.002 * 0.002, 1e-12);
  EXPECT_TRUE(glimpses[3].seen->attitude_doubtful);
  EXPECT_FALSE(glimpses[4].seen->attitude_doubtful);
}

// A frame in which the likelier reading is not found is brought back by its neighbours later.
TEST_F(AttitudeSequence, AFrameLostOverItsReadingIsStillInDoubt) {
  class Blink final : public Oracle {
   public:
    using Oracle::Oracle;
    [[nodiscard]] std::optional<Sighting> find(const Look& look) const override {
      return look.frame.index == 30 ? std::nullopt : Oracle::find(look);
    }
  };
  const auto hardly = [](int) { return 1.0; };
  auto glimpses = tracked(Oracle(hardly), [](int) { return true; });
  const auto doubts = decide_attitudes(background_, Blink(hardly), glimpses);
  EXPECT_FALSE(glimpses[30].seen);
  EXPECT_EQ(doubts.size(), glimpses.size());
}

// Nor do they know more of a frame in which nothing was seen than of themselves.
TEST_F(AttitudeSequence, AFrameWithoutTheBodyIsInDoubtWhereItsNeighboursAre) {
  for (const double tells : {1.0, 10.0}) {
    const Oracle oracle([tells](int) { return tells; });
    auto glimpses = tracked(oracle, [](int) { return false; });
    for (const std::size_t lost : {0u, 29u, 30u}) glimpses[lost].seen.reset();
    const auto doubts = decide_attitudes(background_, oracle, glimpses);
    EXPECT_EQ(doubts.size(), tells > 5.0 ? 0 : glimpses.size()) << tells;
  }
}

// Nor is its tilt known better than between those of the two readings.
TEST_F(AttitudeSequence, TheTiltOfADoubtedFrameHoldsBothReadings) {
  const Oracle oracle([](int) { return 10.0; });
  auto glimpses = tracked(oracle, [](int) { return false; });
  glimpses[3].seen->pose->sigma_theta_rad = 0.03;
  doubt_attitudes({{.at = 3, .off_theta_rad = 0.04}}, glimpses);
  EXPECT_NEAR(glimpses[3].seen->pose->sigma_theta_rad, 0.05, 1e-12);
}

// All pictures of a body share the error of a wall that is not what it is taken for.
TEST_F(AttitudeSequence, WhatHardlyTellsIsDoubtfulHoweverOftenItIsTold) {
  const Oracle oracle([](int) { return 1.0; });
  auto glimpses = tracked(oracle, [](int) { return false; });
  decide(oracle, glimpses);
  for (const Glimpse& g : glimpses) EXPECT_TRUE(g.seen->attitude_doubtful);
}

// Doubtful or not, of two the likelier is taken.
TEST_F(AttitudeSequence, WhatHardlyTellsStillChooses) {
  const Oracle oracle([](int) { return 1.0; });
  auto glimpses = tracked(oracle, [](int) { return true; });
  decide(oracle, glimpses);
  EXPECT_EQ(count_wrong(glimpses), 0);
  for (const Glimpse& g : glimpses) EXPECT_TRUE(g.seen->attitude_doubtful);
}

// At the height of the wrong reading the rim looks too large or too small, now this, now that.
TEST_F(AttitudeSequence, OfTwoReadingsTheOneThatKeepsTheSizeOfTheBodyIsRight) {
  const Oracle oracle([](int) { return -1.0; }, [](int i) { return 0.4 * std::sin(0.2 * i); });
  auto glimpses = tracked(oracle, [](int i) { return i >= 20 && i < 50; });
  decide(oracle, glimpses);
  EXPECT_EQ(count_wrong(glimpses), 0);
  for (const Glimpse& g : glimpses) EXPECT_FALSE(g.seen->attitude_doubtful);
}

// Sizes that tell a little in every frame share their errors as edges do.
TEST_F(AttitudeSequence, SizesThatHardlyTellLeaveItDoubtful) {
  const Oracle oracle([](int) { return 0.0; }, [](int i) { return 0.08 * std::sin(0.2 * i); });
  auto glimpses = tracked(oracle, [](int) { return false; });
  decide(oracle, glimpses);
  for (const Glimpse& g : glimpses) EXPECT_TRUE(g.seen->attitude_doubtful);
}

/// Through a camera that leans.
class Leaning final : public Oracle {
 public:
  /// @param nods_rad  how much a body that goes round the vertical nods once a round, or seems to.
  Leaning(double lean_rad, double nods_rad)
      : Oracle([](int) { return 0.0; }),
        sight_(std::sin(lean_rad), 0.0, std::cos(lean_rad)),
        nods_rad_(nods_rad) {}
  [[nodiscard]] std::optional<data::Pose<>> mirror_image(const data::Pose<>& pose) const override {
    data::Pose<> other = pose;
    const Eigen::Vector3d axis = axis_of(pose);
    set_axis(2.0 * axis.dot(sight_) * sight_ - axis, other);
    return other;
  }
  void nod(Sighting& seen) const {
    seen.pose->pose.theta_rad += nods_rad_ * std::sin(seen.pose->pose.phi_rad);
  }

 private:
  Eigen::Vector3d sight_;
  double nods_rad_;
};

// Weight acts along the vertical: the mirror image of a body that goes round that nods with every
// round, by twice as much as the camera leans.
TEST_F(AttitudeSequence, OfTwoReadingsTheOneThatGoesRoundTheVerticalIsRight) {
  const Leaning oracle(0.2, 0.03);
  auto glimpses = tracked(oracle, [](int) { return false; });
  for (Glimpse& g : glimpses) {
    oracle.nod(*g.seen);
    g.seen->pose->pose = *oracle.mirror_image(g.seen->pose->pose);
  }
  ASSERT_EQ(count_wrong(glimpses), kFrames);
  decide(oracle, glimpses);
  EXPECT_EQ(count_wrong(glimpses), 0);
  for (const Glimpse& g : glimpses) EXPECT_FALSE(g.seen->attitude_doubtful);
}

// A lamp on one side makes a body seem to nod as a leaning camera makes its mirror image.
TEST_F(AttitudeSequence, ACameraThatHardlyLeansDoesNotTell) {
  const Leaning oracle(0.02, 0.03);
  auto glimpses = tracked(oracle, [](int) { return false; });
  for (Glimpse& g : glimpses) oracle.nod(*g.seen);
  decide(oracle, glimpses);
  for (const Glimpse& g : glimpses) EXPECT_TRUE(g.seen->attitude_doubtful);
}

}  // namespace
}  // namespace trochoid::tracking
