#include "pose/robust_step.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace trochoid::tracking {
namespace {

// Edges all round a circle whose centre may move: 1 px of offset along the normal per px.
std::vector<EdgeEquation> round_a_circle(double noise_px, double common_px, std::mt19937& random) {
  constexpr int kEdges = 120;
  std::normal_distribution<double> normal(0.0, noise_px);
  std::vector<EdgeEquation> equations(kEdges);
  for (int i = 0; i < kEdges; ++i) {
    EdgeEquation& e = equations[static_cast<std::size_t>(i)];
    e.direction_rad = std::remainder(2.0 * std::numbers::pi * i / kEdges, 2.0 * std::numbers::pi);
    e.normal = {std::cos(e.direction_rad), std::sin(e.direction_rad)};
    e.motion = e.normal;
    e.tone = 1.0;
    e.model_px = 0.01;
    e.common_px = common_px;
    e.offset_px = normal(random);
    e.variance_px2 = noise_px * noise_px;
  }
  return equations;
}

RobustSolution solved(
    std::vector<EdgeEquation> equations,
    const data::PoseMotion::Step& prior = data::PoseMotion::Step::Constant(2, 30.0)) {
  RobustSolution solution;
  EXPECT_TRUE(solve_robustly(equations, prior, 0.1, true, solution));
  find_uncertainty(equations, prior, false, solution);
  return solution;
}

const data::PoseMotion::Step kShiftsAndTurn = Eigen::Vector3d(30.0, 30.0, 0.5);

// All edges of the lit side 0.05 px too far out, those of the dark side as much too far in, move
// the centre by 0.05 px and leave no residual: whatever the noise, it is no better known than that.
TEST(RobustStep, AnErrorOfAWholeSideIsPartOfTheCovariance) {
  constexpr double kCommon_px = 0.05, kNoise_px = 0.02;
  std::mt19937 random(21);
  const auto equations = round_a_circle(kNoise_px, kCommon_px, random);
  const RobustSolution without = [&] {
    auto free = equations;
    for (EdgeEquation& e : free) e.common_px = 0.0;
    return solved(free);
  }();
  const RobustSolution with = solved(equations);
  for (int axis = 0; axis < 2; ++axis) {
    EXPECT_NEAR(with.covariance(axis, axis) - without.covariance(axis, axis),
                kCommon_px * kCommon_px, 0.1 * kCommon_px * kCommon_px);
    EXPECT_NEAR(with.common(axis, axis), kCommon_px * kCommon_px, 0.1 * kCommon_px * kCommon_px);
    // It is allowed for, not fitted.
    EXPECT_DOUBLE_EQ(with.step[axis], without.step[axis]);
  }
}

// The far rim against the near one: half of the circle each.
TEST(RobustStep, FarRimsMoveAgainstNearOnes) {
  constexpr double kLower_px = 0.08;
  std::mt19937 random(22);
  auto equations = round_a_circle(0.02, 0.0, random);
  for (EdgeEquation& e : equations)
    if (std::cos(e.direction_rad) > 0.0) e.lower_px = kLower_px;
  const RobustSolution solution = solved(equations);
  // Half a circle moved by d moves the best circle of free size by 2 d / pi.
  const double moved_px = 2.0 * kLower_px / std::numbers::pi;
  EXPECT_NEAR(std::sqrt(solution.common(0, 0)), moved_px, 0.15 * moved_px);
  EXPECT_LT(solution.common(1, 1), 0.01 * solution.common(0, 0));
}

// The long sides of an outline against its ends: no shift of the whole, but a tilt, which is seen
// as the outline getting narrower.
TEST(RobustStep, LongSidesMoveAgainstEnds) {
  constexpr double kFlank_px = 0.05, kRadius_px = 40.0;
  std::mt19937 random(23);
  auto equations = round_a_circle(0.02, 0.0, random);
  for (EdgeEquation& e : equations) {
    const double along = std::cos(2.0 * e.direction_rad);
    e.motion =
        Eigen::Vector3d(e.normal.x(), e.normal.y(), -kRadius_px * e.normal.x() * e.normal.x());
    e.flank_px = kFlank_px * along;
  }
  const RobustSolution solution = solved(equations, kShiftsAndTurn);
  // cos^2 = (1 + cos 2) / 2, and a circle of free size takes the one.
  const double tilted_rad = 2.0 * kFlank_px / kRadius_px;
  EXPECT_NEAR(std::sqrt(solution.common(2, 2)), tilted_rad, 0.15 * tilted_rad);
  EXPECT_LT(std::sqrt(solution.common(0, 0)), 0.05 * kFlank_px);
}

// What is wider along one diagonal and narrower along the other is an ellipse that has turned: one
// that is nearly round moves out by the difference of its semi-axes times sin 2t, a radian.
TEST(RobustStep, DiagonalsMoveAgainstEachOther) {
  constexpr double kTwist_px = 0.05, kLonger_px = 8.0;
  std::mt19937 random(24);
  auto equations = round_a_circle(0.02, 0.0, random);
  for (EdgeEquation& e : equations) {
    const double across = std::sin(2.0 * e.direction_rad);
    e.motion = Eigen::Vector3d(e.normal.x(), e.normal.y(), kLonger_px * across);
    e.twist_px = kTwist_px * across;
  }
  const RobustSolution solution = solved(equations, kShiftsAndTurn);
  const double turned_rad = kTwist_px / kLonger_px;
  EXPECT_NEAR(std::sqrt(solution.common(2, 2)), turned_rad, 0.15 * turned_rad);
  EXPECT_LT(std::sqrt(solution.common(0, 0)), 0.05 * kTwist_px);
}

}  // namespace
}  // namespace trochoid::tracking
