#include "link/neighbours.hpp"

#include "glimpsed_sequence.hpp"
#include "link/one_side.hpp"
#include "trochoid/data/pose_motion.hpp"

namespace trochoid::tracking {
namespace {

using Neighbours = GlimpsedSequence;
constexpr double kTurn = 2.0 * std::numbers::pi;

/// Finds the same in one frame wherever it looks.
class StubbornOracle final : public BodyFinder {
 public:
  StubbornOracle(std::int64_t index, double phi_rad) : index_(index), phi_rad_(phi_rad) {}
  [[nodiscard]] std::optional<Sighting> find(const Look& look) const override {
    auto seen = oracle_.find(look);
    if (look.frame.index == index_) seen->pose->pose.phi_rad = phi_rad_;
    return seen;
  }
  void place(Sighting& guess) const override { oracle_.place(guess); }

 private:
  std::int64_t index_;
  double phi_rad_;
  Oracle oracle_{[](int) { return 10.0; }};
};

TEST_F(Neighbours, ALostFrameIsSoughtWhereItsNeighboursPutIt) {
  const Oracle oracle([](int) { return 10.0; });
  auto glimpses = tracked(oracle, [](int) { return false; });
  glimpses[30].seen.reset();
  mend_from_neighbours(background_, oracle, glimpses);
  ASSERT_TRUE(glimpses[30].seen);
  EXPECT_NEAR(std::remainder(glimpses[30].pose().phi_rad - phi_at(0.5), kTurn), 0.0, 0.01);
}

TEST_F(Neighbours, ABodyThatRunsInACircleIsExpectedOnIt) {
  constexpr double kCircle_m = 0.02, kTurn_rad_s = 25.0;  // an eighth of a turn over a lost frame
  const auto centre_at = [](double t_s) {
    return Eigen::Vector3d(kCircle_m * std::cos(kTurn_rad_s * t_s),
                           kCircle_m * std::sin(kTurn_rad_s * t_s), 0.01);
  };
  const Oracle oracle([](int) { return 10.0; });
  auto glimpses = tracked(oracle, [](int) { return false; });
  for (Glimpse& g : glimpses) g.seen->pose->pose.centre_m = centre_at(g.frame->t_s);
  glimpses[30].seen.reset();
  mend_from_neighbours(background_, oracle, glimpses);
  ASSERT_TRUE(glimpses[30].seen);
  // The chord's middle lies 0.09 radii inside.
  EXPECT_LT((glimpses[30].pose().centre_m - centre_at(0.5)).norm(), 0.02 * kCircle_m);
}

TEST_F(Neighbours, ALongGapIsClosedFromItsEnds) {
  // Found only where it is looked for.
  class Narrow final : public Oracle {
   public:
    using Oracle::Oracle;
    [[nodiscard]] std::optional<Sighting> find(const Look& look) const override {
      const double off_rad = look.predicted->pose->pose.phi_rad - phi_at(look.frame.t_s);
      constexpr double kNear_rad = 0.3;
      if (std::abs(std::remainder(off_rad, kTurn)) > kNear_rad) return std::nullopt;
      auto seen = Oracle::find(look);
      seen->pose->pose.phi_rad -= off_rad;
      return seen;
    }
  };
  const Narrow oracle([](int) { return 10.0; });
  auto glimpses = tracked(oracle, [](int) { return false; });
  for (std::size_t i = 8; i < 55; ++i) glimpses[i].seen.reset();
  mend_from_neighbours(background_, oracle, glimpses);
  for (const Glimpse& g : glimpses) {
    ASSERT_TRUE(g.seen) << g.frame->index;
    EXPECT_NEAR(std::remainder(g.pose().phi_rad - phi_at(g.frame->t_s), kTurn), 0.0, 0.01);
  }
}

TEST_F(Neighbours, WrongFramesSideBySideAreOutvotedByThoseAround) {
  const Oracle oracle([](int) { return 10.0; });
  auto glimpses = tracked(oracle, [](int) { return false; });
  for (const std::size_t i : {30u, 31u}) glimpses[i].seen->pose->pose.phi_rad += 2.0;
  mend_from_neighbours(background_, oracle, glimpses);
  for (const std::size_t i : {30u, 31u})
    EXPECT_NEAR(std::remainder(glimpses[i].pose().phi_rad - phi_at(frames_[i].t_s), kTurn), 0.0,
                0.01)
        << i;
}

// From where the frames around put the body a wider look leads off it again.
TEST_F(Neighbours, AWrongFrameFromWhichWiderLooksLeadAwayIsMendedClosely) {
  class Distracted final : public Oracle {
   public:
    using Oracle::Oracle;
    [[nodiscard]] std::optional<Sighting> find(const Look& look) const override {
      auto seen = Oracle::find(look);
      if (look.frame.index == 30 && !look.there) seen->pose->pose.phi_rad += 2.0;
      return seen;
    }
  };
  const Distracted oracle([](int) { return 10.0; });
  auto glimpses = tracked(oracle, [](int) { return false; });
  const auto off_rad = [&] {
    return std::abs(std::remainder(glimpses[30].pose().phi_rad - phi_at(0.5), kTurn));
  };
  mend_from_neighbours(background_, oracle, glimpses);
  EXPECT_GT(off_rad(), 1.0);
  mend_from_neighbours(background_, oracle, glimpses, true);
  EXPECT_LT(off_rad(), 0.01);
}

// The rim of a face beside that of the wall: hardly off the path, and no wide look would be made.
TEST_F(Neighbours, AFrameALittleOffIsLookedAtClosely) {
  constexpr double kOff_rad = 0.02;
  const Oracle oracle([](int) { return 10.0; });
  auto glimpses = tracked(oracle, [](int) { return false; });
  glimpses[30].seen->pose->pose.phi_rad += kOff_rad;
  const auto off_rad = [&] {
    return std::abs(std::remainder(glimpses[30].pose().phi_rad - phi_at(0.5), kTurn));
  };
  mend_from_neighbours(background_, oracle, glimpses);
  EXPECT_NEAR(off_rad(), kOff_rad, 1e-9);
  mend_from_neighbours(background_, oracle, glimpses, true);
  EXPECT_LT(off_rad(), 0.1 * kOff_rad);
}

// A fortieth of a turn would be nothing beside neighbours that scatter; these do not.
TEST_F(Neighbours, OnASmoothPathLittleIsAContradiction) {
  constexpr double kOff_rad = 0.025 * kTurn;
  const Oracle oracle([](int) { return 10.0; });
  auto glimpses = tracked(oracle, [](int) { return false; });
  glimpses[30].seen->pose->pose.phi_rad += kOff_rad;
  mend_from_neighbours(background_, oracle, glimpses);
  EXPECT_NEAR(std::remainder(glimpses[30].pose().phi_rad - phi_at(0.5), kTurn), 0.0, 0.01);
  const StubbornOracle stubborn(30, phi_at(0.5) + kOff_rad);
  glimpses = tracked(stubborn, [](int) { return false; });
  doubt_what_is_contradicted(stubborn, glimpses);
  EXPECT_TRUE(glimpses[30].seen->attitude_doubtful);
}

// Knocked, it goes on otherwise at once. The frame at which it does is as far from the way between
// its neighbours as one that is wrong, but on the way of those before it.
TEST_F(Neighbours, AKnockOnASmoothPathIsNoContradiction) {
  constexpr double kKnock_s = 0.5, kBack_rad_s = -6.0;
  const Oracle oracle([](int) { return 10.0; });
  auto glimpses = tracked(oracle, [](int) { return false; });
  for (Glimpse& g : glimpses)
    if (const double since_s = g.frame->t_s - kKnock_s; since_s > 0.0)
      g.seen->pose->pose.phi_rad = phi_at(kKnock_s) + kBack_rad_s * since_s;
  doubt_what_is_contradicted(oracle, glimpses);
  for (const Glimpse& g : glimpses) EXPECT_FALSE(g.seen->attitude_doubtful) << g.frame->index;
}

// Its azimuth was in doubt already, for its mirror image; that its tilt is wrong as well is not
// said by that.
TEST_F(Neighbours, TheTiltOfADoubtfulFrameIsDoubtedToo) {
  constexpr double kOff_rad = 0.3;
  const Oracle oracle([](int) { return 10.0; });
  auto glimpses = tracked(oracle, [](int) { return false; });
  for (Glimpse& g : glimpses) g.seen->pose->sigma_theta_rad = 0.01;
  glimpses[30].seen->pose->pose.theta_rad -= kOff_rad;
  glimpses[30].seen->attitude_doubtful = true;
  doubt_what_is_contradicted(oracle, glimpses);
  EXPECT_NEAR(glimpses[30].seen->pose->sigma_theta_rad, kOff_rad, 0.02);
}

TEST_F(Neighbours, WhatTheyContradictForGoodIsDoubted) {
  const double wrong_rad = phi_at(0.5) + 1.2;
  const StubbornOracle oracle(30, wrong_rad);
  auto glimpses = tracked(oracle, [](int) { return false; });
  mend_from_neighbours(background_, oracle, glimpses);
  doubt_what_is_contradicted(oracle, glimpses);
  for (std::size_t i = 0; i < glimpses.size(); ++i)
    EXPECT_EQ(glimpses[i].seen->attitude_doubtful, i == 30) << i;
  EXPECT_TRUE(std::isinf(glimpses[30].seen->pose->sigma_phi_rad));
}

TEST_F(Neighbours, AStretchThatSatElsewhereIsFollowedBackFromWhereItEnds) {
  const auto wrong = [](int i) { return i >= 15 && i < 40; };
  const Oracle oracle([](int i) { return i % 3 == 0 ? -5.0 : 10.0; });
  auto glimpses = tracked(oracle, wrong);
  mend_from_one_side(background_, oracle, glimpses);
  EXPECT_EQ(count_wrong(glimpses), 0);
}

// Past the end of a recording no frame can help, and wide looks lead back to where it was seen.
TEST_F(Neighbours, LastFramesThatSatElsewhereAreFollowedClosely) {
  constexpr int kFirstWrong = kFrames - 4;
  class LedBack final : public Oracle {
   public:
    using Oracle::Oracle;
    [[nodiscard]] std::optional<Sighting> find(const Look& look) const override {
      auto seen = Oracle::find(look);
      if (look.frame.index < kFirstWrong || look.there) return seen;
      seen->pose->pose.phi_rad = phi_at(look.frame.t_s) + std::numbers::pi;
      seen->pose->support_px = kSupport_px;
      return seen;
    }
  };
  const LedBack oracle([](int) { return 10.0; });
  auto glimpses = tracked(oracle, [](int) { return false; });
  ASSERT_EQ(count_wrong(glimpses), kFrames - kFirstWrong);
  mend_from_one_side(background_, oracle, glimpses);
  EXPECT_EQ(count_wrong(glimpses), 0);
}

TEST_F(Neighbours, AStretchStaysForWhichNoLessSpeaks) {
  const auto wrong = [](int i) { return i >= 15 && i < 40; };
  const Oracle oracle([](int) { return -1.0; });
  auto glimpses = tracked(oracle, wrong);
  mend_from_one_side(background_, oracle, glimpses);
  EXPECT_GE(count_wrong(glimpses), 25);
}

TEST_F(Neighbours, ABodyThatRocksOverItsFaceIsExpectedOnTheWayBetween) {
  // Tilt and precession do not change evenly there: the one turns round, the other leaps.
  const auto axis_at = [](double t_s) {
    const Eigen::Vector2d level(4.0 * (t_s - 0.5), 0.05);
    return Eigen::Vector3d(level.x(), level.y(), std::sqrt(1.0 - level.squaredNorm()));
  };
  const Oracle oracle([](int) { return 0.0; });
  auto glimpses = tracked(oracle, [](int) { return false; });
  for (Glimpse& g : glimpses)
    if (std::abs(g.frame->t_s - 0.5) < 0.12) set_axis(axis_at(g.frame->t_s), g.seen->pose->pose);
  const std::vector<Glimpse> near(glimpses.begin() + 24, glimpses.begin() + 37);
  std::vector<Glimpse> rocking = near;
  rocking[6].seen.reset();
  mend_from_neighbours(background_, oracle, rocking);
  ASSERT_TRUE(rocking[6].posed());
  EXPECT_LT(between_axes(axis_of(rocking[6].pose()), axis_at(0.5), false), 0.02);
}

}  // namespace
}  // namespace trochoid::tracking
