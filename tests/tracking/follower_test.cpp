#include "find/follower.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <optional>

#include "drawn_clip.hpp"

namespace trochoid::tracking {
namespace {

/// A thin disc on its rim that precesses by most of a radian from frame to frame, while the shutter
/// is open for nearly all of that; every picture is the mean over the exposure.
class SmearedDisc : public testing::Test {
 protected:
  static constexpr int kWidth = 200, kHeight = 160;
  static constexpr double kTilt_rad = 1.0, kPerFrame_rad = 0.9, kExposure = 0.8;
  static constexpr double kRadius_px = 30.0, kScale_px_per_m = 2000.0, kFrame_s = 0.01;

  SmearedDisc()
      : floor_(drawn_floor(kWidth, kHeight, 150.0)),
        camera_(data::Camera::from_scale(kWidth, kHeight, kScale_px_per_m)) {
    cv::Mat plate;
    floor_.convertTo(plate, CV_8U);
    background_ = Background::from_samples({{plate}, {}});
    data::Body body;
    body.radius_m = kRadius_px / kScale_px_per_m;
    body.thickness_m = 1e-4;
    finder_ = make_cylinder_finder(body, {}, camera_, kExposure);
  }

  /// @param phi_rad, centre_px in the middle of the exposure.
  Frame frame(int index, double phi_rad, const Eigen::Vector2d& centre_px) {
    constexpr int kMoments = 25;
    cv::Mat mean = cv::Mat::zeros(floor_.size(), CV_64F);
    for (int k = 0; k < kMoments; ++k) {
      const double phi = phi_rad + kPerFrame_rad * kExposure * ((k + 0.5) / kMoments - 0.5);
      cv::Mat moment = floor_.clone();
      draw_disc(moment, centre_px.x(), centre_px.y(), kRadius_px, kRadius_px * std::cos(kTilt_rad),
                -phi, 100.0);
      mean += moment / kMoments;
    }
    Frame frame;
    frame.luma = developed(mean, 2.0, random_);
    frame.index = index;
    frame.t_s = kFrame_s * index;
    return frame;
  }

  /// Measured about where it is.
  std::optional<Sighting> seen_in(const Frame& frame, double phi_rad,
                                  const Eigen::Vector2d& centre_px) {
    const auto guess_at = [&](double phi) {
      Sighting guess;
      guess.pose.emplace();
      guess.pose->pose.theta_rad = kTilt_rad;
      guess.pose->pose.phi_rad = phi;
      const double height_m = kRadius_px / kScale_px_per_m * std::sin(kTilt_rad);
      guess.pose->pose.centre_m = camera_.table_from_image(centre_px, height_m);
      guess.pose->blur_px = 0.7;
      finder_->place(guess);
      return guess;
    };
    const Sighting now = guess_at(phi_rad), before = guess_at(phi_rad - kPerFrame_rad);
    const Plate plate = background_.plate();
    Look look{.frame = frame, .background = plate};
    look.predicted = &now;
    look.last = &before;
    return finder_->find(look);
  }

  cv::Mat floor_;
  data::Camera camera_;
  Background background_;
  std::unique_ptr<BodyFinder> finder_;
  std::mt19937 random_{5};
};

// One sighting tells no speed: by the next picture the disc may have gone most of its width.
TEST_F(SmearedDisc, IsFoundAFrameAfterItWasFirstSeenThoughItWentMoreThanItsRadius) {
  constexpr double kGone_px = 1.5 * kRadius_px;
  const Eigen::Vector2d at(60.0, 80.0), gone_to = at + kGone_px * Eigen::Vector2d(1.0, 0.1);
  const Frame first = frame(0, 0.3, at), second = frame(1, 0.3 + kPerFrame_rad, gone_to);
  const auto one = seen_in(first, 0.3, at);
  ASSERT_TRUE(one);
  Follower follower(*finder_, background_, nullptr);
  follower.start(first, *one);
  const auto again = follower.follow(second);
  ASSERT_TRUE(again);
  EXPECT_LT((again->centre_px - gone_to).norm(), 2.0);
}

// After a knock it is neither where nor how any guess has it, and a look at one picture alone takes
// it for still.
TEST_F(SmearedDisc, IsFoundAgainAfterAKnock) {
  constexpr int kKnocks = 12;
  int found = 0;
  for (int k = 0; k < kKnocks; ++k) {
    const double phi = 0.37 * k, knocked = phi + kPerFrame_rad + 1.3;
    const Eigen::Vector2d at(95.0, 80.0), knocked_to(106.0, 72.0);
    const Frame first = frame(0, phi, at), second = frame(1, phi + kPerFrame_rad, at),
                third = frame(2, knocked, knocked_to);
    const auto one = seen_in(first, phi, at), two = seen_in(second, phi + kPerFrame_rad, at);
    ASSERT_TRUE(one && two);
    Follower follower(*finder_, background_, nullptr);
    follower.start(first, *one);
    follower.resume({{first.t_s, *one}, {second.t_s, *two}}, {first.t_s, second.t_s});
    const auto again = follower.follow(third);
    if (again && (again->centre_px - knocked_to).norm() < 0.5) ++found;
  }
  // By looks that take it for still, three.
  EXPECT_GE(found, kKnocks - 2);
}

// A disc that had been lost, and was then found in those frames by what those around them say, is
// looked for as one seen in the frame before: its smear is known.
TEST_F(SmearedDisc, GoesOnAsIfItHadNeverBeenLostWhereItsFramesWereMended) {
  constexpr int kLost = 3;
  const Eigen::Vector2d at(95.0, 80.0);
  const auto phi = [](int i) { return 0.3 + kPerFrame_rad * i; };
  std::vector<Frame> frames;
  for (int i = 0; i <= kLost + 2; ++i) frames.push_back(frame(i, phi(i), at));
  std::vector<std::pair<double, Sighting>> seen;
  std::vector<double> frames_s;
  for (int i = 0; i <= kLost + 1; ++i) {
    const Frame& frame = frames[static_cast<std::size_t>(i)];
    const auto sighting = seen_in(frame, phi(i), at);
    ASSERT_TRUE(sighting);
    seen.emplace_back(frame.t_s, *sighting);
    frames_s.push_back(frame.t_s);
  }
  const auto found_after = [&](int hidden) {
    Follower follower(*finder_, background_, nullptr);
    follower.start(frames[0], seen[0].second);
    for (int i = 1; i <= kLost + 1; ++i) {
      Frame shown = frames[static_cast<std::size_t>(i)];
      if (i > kLost + 1 - hidden) shown.luma = background_.plate().luma;
      EXPECT_EQ(follower.follow(shown).has_value(), i <= kLost + 1 - hidden) << i;
    }
    follower.resume(seen, frames_s);
    return follower.follow(frames.back());
  };
  const auto never_lost = found_after(0), lost = found_after(kLost);
  ASSERT_TRUE(never_lost && lost);
  EXPECT_LT((lost->centre_px - never_lost->centre_px).norm(), 0.02);
  EXPECT_LT((lost->centre_px - at).norm(), 0.3);
}

// Hidden for 40 ms, in which it goes three times its radius. Thirty frames of a slower recording
// would be long enough to look for it anywhere, and to take the other disc for it.
TEST(FastRecording, ABodyHiddenForFortyFramesOfAThousandASecondIsNotTakenForAnother) {
  constexpr int kHiddenFrom = 10, kHiddenTo = 50, kFrames = 60;
  constexpr double kDisc_px = 14.0, kPerFrame_px = 1.0, kFrame_s = 1e-3;
  const cv::Mat floor = drawn_floor(300, 120, 150.0);
  cv::Mat plate;
  floor.convertTo(plate, CV_8U);
  const Background background = Background::from_samples({{plate}, {}});
  const auto finder = make_rim_finder();
  std::mt19937 random(3);
  const auto at = [](int i) { return Eigen::Vector2d(40.0 + kPerFrame_px * i, 60.0); };
  const auto frame_of = [&](int i) {
    cv::Mat picture = floor.clone();
    draw_disc(picture, 260.0, 60.0, kDisc_px, kDisc_px, 0.0, 60.0);
    if (i < kHiddenFrom || i >= kHiddenTo)
      draw_disc(picture, at(i).x(), at(i).y(), kDisc_px, kDisc_px, 0.0, 60.0);
    Frame frame;
    frame.luma = developed(picture, 1.0, random);
    frame.index = i;
    frame.t_s = kFrame_s * i;
    return frame;
  };
  const Frame first = frame_of(0);
  Look look{.frame = first, .background = background.plate()};
  Sighting guess;
  guess.rim = Ellipse::from_axes(at(0), kDisc_px, kDisc_px, 0.0);
  guess.centre_px = at(0);
  look.predicted = &guess;
  const auto one = finder->find(look);
  ASSERT_TRUE(one);
  Follower follower(*finder, background, nullptr);
  follower.start(first, *one);
  for (int i = 1; i < kFrames; ++i) {
    const auto seen = follower.follow(frame_of(i));
    if (i >= kHiddenFrom && i < kHiddenTo) {
      EXPECT_FALSE(seen) << i;
    } else if (i < kHiddenFrom || i >= kHiddenTo + 3) {
      // After so long a search is made in every third frame.
      ASSERT_TRUE(seen) << i;
      EXPECT_LT((seen->centre_px - at(i)).norm(), 0.5) << i;
    }
  }
}

}  // namespace
}  // namespace trochoid::tracking
