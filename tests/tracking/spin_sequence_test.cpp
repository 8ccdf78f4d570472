#include "link/spin_sequence.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

namespace trochoid::tracking {
namespace {

constexpr int kGlimpses = 40;
constexpr double kRate_rad_s = 110.0, kPrecession_rad_s = 30.0, kFrame_s = 1.0 / 60.0;

// A body that turns fast about its own axis, and the axis about the vertical.
struct Spinning {
  std::vector<Frame> frames{kGlimpses};
  std::vector<Glimpse> glimpses;

  explicit Spinning(double faster_rad_s = 0.0, int from_frame = kGlimpses / 2,
                    double slower_by_rad_s2 = 0.0) {
    double turned_rad = 0.0;
    for (int i = 0; i < kGlimpses; ++i) {
      Frame& frame = frames[static_cast<std::size_t>(i)];
      frame.index = i;
      frame.t_s = kFrame_s * i;
      PoseMeasurement& pose = glimpses.emplace_back(Glimpse{&frame}).seen.emplace().pose.emplace();
      pose.pose.theta_rad = 0.5;
      pose.pose.phi_rad = kPrecession_rad_s * frame.t_s;
      pose.pose.psi_rad = turned_rad - std::cos(0.5) * pose.pose.phi_rad + 0.02 * (i % 3 - 1);
      pose.sigma_psi_rad = 0.02;
      turned_rad += kFrame_s * (kRate_rad_s + (i >= from_frame ? faster_rad_s : 0.0) -
                                slower_by_rad_s2 * frame.t_s);
    }
  }

  [[nodiscard]] PoseMeasurement& pose(std::size_t i) { return *glimpses[i].seen->pose; }

  [[nodiscard]] std::vector<std::size_t> forgotten() {
    std::vector<std::size_t> before, out;
    for (std::size_t i = 0; i < kGlimpses; ++i)
      if (pose(i).sigma_psi_rad) before.push_back(i);
    forget_spins_off_their_sequence(glimpses);
    for (const std::size_t i : before)
      if (!pose(i).sigma_psi_rad) out.push_back(i);
    return out;
  }
};

TEST(SpinSequence, OfASteadySpinNothingIsForgotten) {
  EXPECT_TRUE(Spinning().forgotten().empty());
}

TEST(SpinSequence, AMarkTakenForWhatIsOppositeIsForgottenAndItsNeighboursAreNot) {
  Spinning body;
  for (const std::size_t i : {0U, 17U, 18U}) body.pose(i).pose.psi_rad += std::numbers::pi;
  EXPECT_EQ(body.forgotten(), (std::vector<std::size_t>{0, 17, 18}));
}

TEST(SpinSequence, GapsAreNoReason) {
  Spinning body;
  for (const std::size_t i : {2U, 3U, 4U, 20U, 22U, 24U, 25U}) body.pose(i).sigma_psi_rad.reset();
  body.pose(21).pose.psi_rad -= 2.0;
  EXPECT_EQ(body.forgotten(), std::vector<std::size_t>{21});
}

// Glints had hidden a bright mark for seven frames, and left a dark corner in two of them.
TEST(SpinSequence, ADarkMarkWhereAllOthersAreBrightIsForgottenUnlessItGoesOnWithThem) {
  Spinning body;
  for (std::size_t i = 0; i < kGlimpses; ++i) body.pose(i).bright_marks = i != 5 && i != 20;
  for (const std::size_t i : {17U, 18U, 19U, 21U, 22U, 23U}) body.pose(i).sigma_psi_rad.reset();
  body.pose(20).pose.psi_rad += 1.3;
  EXPECT_EQ(body.forgotten(), std::vector<std::size_t>{20});
}

TEST(SpinSequence, AnImpactThatChangesTheSpinIsNone) {
  for (const int frame : {3, 4, 5, 6, 8, kGlimpses / 2, kGlimpses - 4})
    EXPECT_TRUE(Spinning(-90.0, frame).forgotten().empty()) << frame;
}

TEST(SpinSequence, NorIsASpinThatDiesFast) {
  EXPECT_TRUE(Spinning(0.0, 0, 1200.0).forgotten().empty());
}

TEST(SpinSequence, WhereTooFewAreNearNothingIsForgotten) {
  Spinning body;
  for (std::size_t i = 0; i < kGlimpses; ++i)
    if (i % 8 != 0) body.pose(i).sigma_psi_rad.reset();
  body.pose(16).pose.psi_rad += 2.0;
  EXPECT_TRUE(body.forgotten().empty());
}

}  // namespace
}  // namespace trochoid::tracking
