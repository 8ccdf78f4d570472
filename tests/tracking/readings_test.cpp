#include "link/readings.hpp"

#include "glimpsed_sequence.hpp"
#include "pose/pose_start.hpp"
#include "trochoid/data/pose_motion.hpp"

namespace trochoid::tracking {
namespace {

constexpr double kOff_rad = 0.3, kOff_m = 1e-3;  // between the two readings of a picture

/// Finds either of two attitudes, whichever it is led to, the true one with more support or less.
class TwoReadings : public BodyFinder {
 public:
  /// @param of_the_way how far off the other one is really found, of how far off it should be.
  explicit TwoReadings(std::function<double(int)> bonus_of_truth, double of_the_way = 1.0)
      : bonus_of_truth_(std::move(bonus_of_truth)), found_rad_(of_the_way * kOff_rad) {}
  [[nodiscard]] std::optional<Sighting> find(const Look& look) const override {
    Sighting seen = *look.predicted;
    double& theta = seen.pose->pose.theta_rad;
    const bool right = theta < kTilt + 0.5 * kOff_rad;
    theta = right ? kTilt : kTilt + found_rad_;
    seen.pose->pose.phi_rad = phi_at(look.frame.t_s);
    seen.pose->support_px =
        kSupport_px + (right ? bonus_of_truth_(static_cast<int>(look.frame.index)) : 0.0);
    seen.pose->covariance_m2 = 1e-8 * Eigen::Matrix2d::Identity();
    return seen;
  }
  void place(Sighting& guess) const override {
    guess.rim = Ellipse::from_axes({32.0, 32.0}, 10.0, 8.0, 0.0);
    guess.centre_px = guess.rim.centre_px;
  }
  [[nodiscard]] OtherReadings other_readings(const data::Pose<>& pose) const override {
    data::Pose<> steeper = pose, flatter = pose;
    steeper.theta_rad += kOff_rad;
    flatter.theta_rad -= kOff_rad;
    steeper.centre_m.x() += kOff_m;
    return {steeper, flatter};
  }

 private:
  std::function<double(int)> bonus_of_truth_;
  double found_rad_;
};

/// Of two attitudes that are each other's mirror image.
class MirroredReadings final : public TwoReadings {
 public:
  using TwoReadings::TwoReadings;
  [[nodiscard]] std::optional<data::Pose<>> mirror_image(const data::Pose<>& pose) const override {
    data::Pose<> other = pose;
    other.theta_rad += pose.theta_rad < kTilt + 0.5 * kOff_rad ? kOff_rad : -kOff_rad;
    return other;
  }
};

class Readings : public GlimpsedSequence {
 protected:
  /// As tracked, on the other edge where `wrong` says so, then chosen anew.
  /// @param log_odds of all attitudes to their mirror images.
  std::vector<Glimpse> chosen(const BodyFinder& finder, const std::function<bool(int)>& wrong,
                              double log_odds = 0.0) {
    auto glimpses = tracked(finder, [](int) { return false; });
    for (Glimpse& g : glimpses) {
      Sighting guess = *g.seen;
      if (wrong(static_cast<int>(g.frame->index))) guess.pose->pose.theta_rad += kOff_rad;
      Look look{.frame = *g.frame, .background = background_.plate()};
      look.predicted = &guess;
      g.seen = finder.find(look);
      g.attitude_log_odds = log_odds;
    }
    (void)choose_readings(background_, finder, glimpses);
    return glimpses;
  }
  /// What the frame with the largest holds of other readings.
  PoseSpread doubted(const BodyFinder& finder) {
    auto glimpses = tracked(finder, [](int) { return false; });
    const ReadingDoubt doubt = choose_readings(background_, finder, glimpses);
    place_other_readings(finder, 0, glimpses);
    PoseSpread most;
    for (const Glimpse& g : glimpses)
      if (const auto spread = spread_over_readings(doubt.tallies, *g.seen);
          spread.theta_rad2 >= most.theta_rad2)
        most = spread;
    return most;
  }
  double doubted_rad(const BodyFinder& finder) { return std::sqrt(doubted(finder).theta_rad2); }
  static int count_off(const std::vector<Glimpse>& glimpses) {
    return static_cast<int>(std::count_if(glimpses.begin(), glimpses.end(), [](const Glimpse& g) {
      return g.pose().theta_rad > kTilt + 0.5 * kOff_rad;
    }));
  }
};

TEST_F(Readings, ARecordingOnAnotherEdgeIsFoundOutByWhatAllPicturesSayTogether) {
  // By a twentieth, which no picture's score is to be trusted with.
  const TwoReadings finder([](int i) { return i % 2 == 0 ? 15.0 : -5.0; });
  EXPECT_EQ(count_off(chosen(finder, [](int) { return true; })), 0);
}

TEST_F(Readings, SomePicturesDoNotDecideAgainstAllOthers) {
  const TwoReadings finder([](int i) { return i % 12 == 6 ? -15.0 : 5.0; });
  EXPECT_EQ(count_off(chosen(finder, [](int) { return false; })), 0);
}

TEST_F(Readings, AStretchThatLeavesThePathIsLedBackThoughALittleMoreSpeaksForIt) {
  const auto astray = [](int i) { return i >= 25 && i < 30; };
  const TwoReadings finder([&](int i) { return astray(i) ? -4.0 : 4.0; });
  EXPECT_EQ(count_off(chosen(finder, astray)), 0);
}

TEST_F(Readings, ALeapStaysThatThePicturesBearOut) {
  const TwoReadings finder([](int i) { return i < 30 ? 10.0 : -10.0; });
  EXPECT_EQ(count_off(chosen(finder, [](int i) { return i >= 30; })), 30);
}

// Whether it was seen mirrored is decided by more than how well outlines fit.
TEST_F(Readings, AStretchWhoseMirrorImageFitsBetterStaysWhereAllPicturesDecided) {
  const MirroredReadings finder([](int i) { return i >= 20 && i < 40 ? -30.0 : 5.0; });
  const auto as_it_is = [](int) { return false; };
  ASSERT_GT(count_off(chosen(finder, as_it_is)), 15);
  EXPECT_EQ(count_off(chosen(finder, as_it_is, 20.0)), 0);
}

TEST_F(Readings, WhatNoPictureTellsApartIsHeldByTheErrorOfTheTilt) {
  const TwoReadings finder([](int) { return 1.0; });
  EXPECT_GT(doubted_rad(finder), 0.5 * kOff_rad);
}

TEST_F(Readings, WhatNoPictureTellsApartIsHeldByTheErrorOfTheCentre) {
  const TwoReadings finder([](int) { return 1.0; });
  EXPECT_GT(std::sqrt(doubted(finder).m2(0, 0)), 0.5 * kOff_m);
}

TEST_F(Readings, APictureLookedAtInAnotherReadingIsDoubtedAsFarAsItLeadsThere) {
  const auto tells_nothing = [](int) { return 1.0; };
  const double all_the_way_rad = doubted_rad(TwoReadings(tells_nothing));
  EXPECT_NEAR(doubted_rad(TwoReadings(tells_nothing, 0.6)), 0.6 * all_the_way_rad,
              0.1 * all_the_way_rad);
  // Far beyond: that is the mirror image, and not for the sake of this reading to be feared.
  EXPECT_EQ(doubted_rad(TwoReadings(tells_nothing, 2.5)), 0.0);
}

// A stretch of a long recording has few frames that are looked at.
TEST_F(Readings, WhatALongRecordingTellsApartAStretchOfItMayNot) {
  const ReadingTally stretch{
      .looked_at = 2.0, .found = 2.0, .log_score_ratio = -0.8, .square = 2.0};
  ReadingTally recording;
  for (int i = 0; i < 50; ++i) recording.add(stretch);
  EXPECT_GT(stretch.expected_square(), 1.5 * recording.expected_square());
  EXPECT_GT(recording.expected_square(), 0.02);
}

TEST_F(Readings, WhatAllPicturesTellApartLeavesTheErrorOfTheTiltAsItIs) {
  const TwoReadings finder([](int) { return 80.0; });
  EXPECT_LT(doubted_rad(finder), 0.02 * kOff_rad);
}

// A wall as high as it is: the face alone is outlined less round than face and wall together.
TEST(OtherReadings, TheWholeIsFoundAgainFromTheFaceThatWasOutlinedLikeIt) {
  data::Body body;
  body.radius_m = 0.03, body.thickness_m = 0.012;
  const data::Camera camera = data::Camera::overhead(640, 480, 2000.0, 3.0);
  const data::PoseMotion motion(body, {data::SupportKind::floor, {}}, camera);
  constexpr double kParallax_rad = 0.01, kParallax_m = 1e-4;  // about what the body's size subtends
  for (const double theta : {0.5, 0.9, 1.2}) {
    data::Pose<> pose;
    pose.theta_rad = theta, pose.phi_rad = 0.4;
    pose = motion.settled(pose);
    const auto face = face_outlined_like(body, camera, motion, pose, Side::same);
    ASSERT_TRUE(face) << theta;
    EXPECT_LT(face->theta_rad, theta - 0.1);
    const auto whole = outlined_like_face(body, camera, motion, *face);
    ASSERT_TRUE(whole) << theta;
    EXPECT_NEAR(whole->theta_rad, theta, kParallax_rad);
    EXPECT_LT((whole->centre_m - pose.centre_m).norm(), kParallax_m);
  }
}

}  // namespace
}  // namespace trochoid::tracking
