#include "link/lying.hpp"

#include <algorithm>
#include <memory>

#include "glimpsed_sequence.hpp"

namespace trochoid::tracking {
namespace {

/// Finds whatever is predicted, lying bodies with so much support.
class Floor final : public BodyFinder {
 public:
  explicit Floor(double lying_px) : lying_(std::make_unique<Floor>()) {
    lying_->support_px_ = lying_px;
  }
  Floor() = default;

  [[nodiscard]] std::optional<Sighting> find(const Look& look) const override {
    Sighting seen = *look.predicted;
    seen.pose->support_px = support_px_;
    seen.accepted = 0.9;
    return seen;
  }
  void place(Sighting& guess) const override {
    guess.rim = Ellipse::from_axes({32.0, 32.0}, 10.0, 8.0, 0.0);
    guess.centre_px = guess.rim.centre_px;
  }
  [[nodiscard]] const BodyFinder* lying() const override { return lying_.get(); }

 private:
  double support_px_ = kSupport_px;
  std::unique_ptr<Floor> lying_;
};

class Lying : public GlimpsedSequence {
 protected:
  /// Tracked with a tilt of 0.4 at phi_at(t), or with an axis that stays.
  std::vector<Glimpse> seen_by(const Floor& floor, bool precesses) {
    auto glimpses = tracked(floor, [](int) { return false; });
    for (Glimpse& g : glimpses) {
      g.seen->pose->pose.theta_rad = 0.4;
      if (!precesses) g.seen->pose->pose.phi_rad = 0.3;
    }
    return glimpses;
  }
  static int count_lying(const std::vector<Glimpse>& glimpses) {
    return static_cast<int>(std::count_if(glimpses.begin(), glimpses.end(), [](const Glimpse& g) {
      return g.seen->pose->pose.theta_rad == 0.0 && g.seen->pose->sigma_theta_rad < 0.02;
    }));
  }
};

TEST_F(Lying, ABodyWhoseAxisStaysLiesIfItLooksSo) {
  const Floor floor(0.95 * kSupport_px);
  auto glimpses = seen_by(floor, false);
  measure_what_lies(background_, floor, glimpses);
  EXPECT_EQ(count_lying(glimpses), kFrames);
}

// Raised on one side it would darken the floor there.
TEST_F(Lying, ABodyWhoseAxisStaysLiesIfItLacksTheShadowOfATilt) {
  const Floor floor(0.8 * kSupport_px);
  for (const double agrees : {0.0, -1.0}) {
    auto glimpses = seen_by(floor, false);
    for (Glimpse& g : glimpses) g.seen->shadow = agrees;
    measure_what_lies(background_, floor, glimpses);
    EXPECT_EQ(count_lying(glimpses), agrees < 0.0 ? kFrames : 0) << agrees;
  }
}

TEST_F(Lying, ABodyThatPrecessesDoesNotLieWhateverItLooksLike) {
  const Floor floor(1.5 * kSupport_px);
  auto glimpses = seen_by(floor, true);
  measure_what_lies(background_, floor, glimpses);
  EXPECT_EQ(count_lying(glimpses), 0);
}

TEST_F(Lying, ABodyHeldTiltedDoesNotLookAsIfItLay) {
  const Floor floor(0.6 * kSupport_px);
  auto glimpses = seen_by(floor, false);
  measure_what_lies(background_, floor, glimpses);
  EXPECT_EQ(count_lying(glimpses), 0);
}

}  // namespace
}  // namespace trochoid::tracking
