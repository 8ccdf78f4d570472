#include "link/shadows.hpp"

#include <gtest/gtest.h>

#include "drawn_shadow.hpp"
#include "edges/transfer_curve.hpp"
#include "glimpsed_sequence.hpp"
#include "link/attitude_sequence.hpp"

namespace trochoid::tracking {
namespace {

const Eigen::Vector2d kAside = lamp_places()[30];

/// Edges that do not tell, over a floor that may.
class OverAFloor final : public Oracle {
 public:
  OverAFloor() : Oracle([](int) { return 0.0; }) {}
  [[nodiscard]] std::optional<FloorDarkening> floor_around(
      const Frame& frame, const Plate& background, const data::Pose<>& pose) const override {
    return FloorDarkening(frame.luma, background.luma, drawn_body(),
                          standing(pose.theta_rad, pose.phi_rad), drawn_camera());
  }
  void place(Sighting& guess) const override {
    guess.rim = Ellipse::from_axes({119.5, 119.5}, 30.0, 25.0, 0.0);
    guess.centre_px = guess.rim.centre_px;
  }
};

class Shadows : public GlimpsedSequence {
 protected:
  /// Every frame as the truth is lit, or not.
  void light(bool shadows) {
    background_ = Background::from_samples({{drawn_floor()}, {}});
    for (Frame& frame : frames_)
      frame.luma =
          shadows ? drawn_with_shadow(standing(kTilt, phi_at(frame.t_s)), kAside) : drawn_floor();
  }
  /// As tracked, mirrored for a third of the time, with rims where they are.
  std::vector<Glimpse> glimpses() {
    auto all = tracked(finder_, [](int i) { return i >= 20 && i < 40; });
    for (Glimpse& g : all) finder_.place(*g.seen);
    return all;
  }
  OverAFloor finder_;
};

TEST_F(Shadows, TheLampIsFoundThoughAThirdOfTheFramesIsMirrored) {
  light(true);
  const auto lamp = find_lamp(background_, finder_, glimpses());
  ASSERT_TRUE(lamp);
  EXPECT_LT((lamp->aside - kAside).norm(), 1e-9);
  EXPECT_NEAR(lamp->part, 1.0 - light_of(kInShadow) / light_of(kFloor), 0.1);
}

TEST_F(Shadows, WithoutAShadowThereIsNoLamp) {
  light(false);
  EXPECT_FALSE(find_lamp(background_, finder_, glimpses()));
}

TEST_F(Shadows, ASequenceWithoutTheBodyHasNoLamp) {
  light(true);
  auto all = glimpses();
  for (Glimpse& g : all) g.seen.reset();
  EXPECT_FALSE(find_lamp(background_, finder_, all));
}

// What edges leave open the shadow decides, and without doubt.
TEST_F(Shadows, ShadowsTurnBackWhatWasSeenMirrored) {
  light(true);
  auto all = glimpses();
  ASSERT_EQ(count_wrong(all), 20);
  const Background lit = background_.lit_by(find_lamp(background_, finder_, all));
  look_at_shadows(lit, finder_, all);
  doubt_attitudes(decide_attitudes(lit, finder_, all), all);
  EXPECT_EQ(count_wrong(all), 0);
  for (const Glimpse& g : all) EXPECT_FALSE(g.seen->attitude_doubtful);
}

// In some directions the body hides where they differ.
TEST_F(Shadows, MoreSpeaksForAFitThanForItsMirrorImageWithAnotherShadow) {
  light(true);
  auto all = tracked(finder_, [](int) { return false; }),
       mirrored = tracked(finder_, [](int) { return true; });
  const Background lit = background_.lit_by(find_lamp(background_, finder_, all));
  look_at_shadows(lit, finder_, all);
  look_at_shadows(lit, finder_, mirrored);
  double sum = 0.0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    EXPECT_GT(log_score_ratio(*all[i].seen, *mirrored[i].seen), -0.05) << i;
    sum += log_score_ratio(*all[i].seen, *mirrored[i].seen);
  }
  EXPECT_GT(sum / kFrames, 0.2);
}

// A dark body would be the shadow of a fit beside it.
TEST_F(Shadows, ShadowsOfFitsThatCoverOtherPlacesAreNotCompared) {
  light(true);
  auto all = glimpses();
  Sighting one = *all[0].seen, other = one;
  one.shadow = 0.8, other.shadow = 0.1;
  EXPECT_GT(log_score_ratio(one, other), 0.3);
  other.centre_px.x() += 0.5 * one.rim.semi_major_px();
  EXPECT_EQ(log_score_ratio(one, other), 0.0);
}

}  // namespace
}  // namespace trochoid::tracking
