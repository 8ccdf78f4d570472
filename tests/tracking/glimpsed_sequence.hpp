#pragma once
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "link/glimpse.hpp"

namespace trochoid::tracking {

inline constexpr double kTilt = 0.7, kSupport_px = 100.0;
inline constexpr int kFrames = 60;

inline double phi_at(double t_s) {
  return 0.3 + 9.0 * t_s;
}

/// A finder that always finds what is predicted and finds the truth a little more convincing, but
/// for some frames that support the mirror image.
class Oracle : public BodyFinder {
 public:
  /// @param mirrored_larger_px  by how much the rim of a frame's mirror image should look smaller,
  ///                            being farther from the camera, than it does.
  explicit Oracle(
      std::function<double(int)> bonus_of_truth,
      std::function<double(int)> mirrored_larger_px = [](int) { return 0.0; })
      : bonus_of_truth_(std::move(bonus_of_truth)),
        mirrored_larger_px_(std::move(mirrored_larger_px)) {}

  [[nodiscard]] std::optional<Sighting> find(const Look& look) const override {
    Sighting seen = *look.predicted;
    const double off =
        std::remainder(seen.pose->pose.phi_rad - phi_at(look.frame.t_s), 2.0 * std::numbers::pi);
    const bool right = std::abs(off) < 0.5 * std::numbers::pi;
    const int frame = static_cast<int>(look.frame.index);
    seen.pose->support_px = kSupport_px + (right ? bonus_of_truth_(frame) : 0.0);
    seen.accepted = 0.9;
    // Edges of all frames look so much too far out.
    constexpr double kUsual_px = 0.2;
    const double larger_px = right ? 0.0 : mirrored_larger_px_(frame);
    seen.pose->larger_px = kUsual_px + larger_px;
    seen.rim = Ellipse::from_axes({32.0, 32.0}, 10.0 - larger_px, 8.0, 0.0);
    return seen;
  }
  void place(Sighting& guess) const override {
    guess.rim = Ellipse::from_axes({32.0, 32.0}, 10.0, 8.0, 0.0);
    guess.centre_px = guess.rim.centre_px;
  }
  /// Seen from straight above.
  [[nodiscard]] std::optional<data::Pose<>> mirror_image(const data::Pose<>& pose) const override {
    data::Pose<> other = pose;
    other.phi_rad += std::numbers::pi;
    return other;
  }

 private:
  std::function<double(int)> bonus_of_truth_, mirrored_larger_px_;
};

class GlimpsedSequence : public testing::Test {
 protected:
  GlimpsedSequence() : background_(Background::from_samples({{cv::Mat(64, 64, CV_8U, 90)}, {}})) {
    for (int i = 0; i < kFrames; ++i) {
      Frame frame;
      frame.luma = cv::Mat(64, 64, CV_8U, cv::Scalar(90));
      frame.index = i;
      frame.t_s = i / 60.0;
      frames_.push_back(frame);
    }
  }

  /// As tracked: mirrored where `wrong` says so.
  std::vector<Glimpse> tracked(const BodyFinder& finder, const std::function<bool(int)>& wrong) {
    std::vector<Glimpse> glimpses;
    const Plate plate = background_.plate();
    for (int i = 0; i < kFrames; ++i) {
      const Frame& frame = frames_[static_cast<std::size_t>(i)];
      Sighting guess;
      guess.pose.emplace();
      guess.pose->pose.theta_rad = kTilt;
      guess.pose->pose.phi_rad = phi_at(frame.t_s) + (wrong(i) ? std::numbers::pi : 0.0);
      finder.place(guess);
      Look look{.frame = frame, .background = plate};
      look.predicted = &guess;
      glimpses.push_back({&frame, finder.find(look)});
    }
    return glimpses;
  }

  static int count_wrong(const std::vector<Glimpse>& glimpses) {
    int wrong = 0;
    for (const Glimpse& g : glimpses)
      wrong += std::cos(g.seen->pose->pose.phi_rad - phi_at(g.frame->t_s)) < 0.0;
    return wrong;
  }

  std::vector<Frame> frames_;
  Background background_;
};

}  // namespace trochoid::tracking
