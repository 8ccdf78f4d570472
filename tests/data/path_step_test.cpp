#include "trochoid/data/path_step.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace trochoid::data {
namespace {

constexpr double kStep_s = 0.01;

// Of a round of two seconds.
Eigen::Vector2d place(double frame) {
  const double turned = 3.14 * kStep_s * frame;
  return {std::cos(turned), std::sin(turned)};
}

// A hundred pictures, of which from the fiftieth on each is so many frames later than its time.
std::vector<PathStep> steps_of(double frames, double noise) {
  std::mt19937 generator(5);
  std::normal_distribution<double> normal;
  std::vector<double> t_s;
  Eigen::MatrixX2d at(100, 2);
  for (int i = 0; i < 100; ++i) {
    t_s.push_back(kStep_s * i);
    at.row(i) = place(i + (i >= 50 ? frames : 0.0)) +
                noise * Eigen::Vector2d(normal(generator), normal(generator));
  }
  return path_steps(t_s, at);
}

TEST(PathSteps, TellWholeFramesThatAreMissingOrTooMany) {
  for (const double frames : {1.0, 3.0, -1.0, -2.0}) {
    const auto steps = steps_of(frames, 1e-3);
    ASSERT_EQ(steps.size(), 1U) << frames;
    EXPECT_EQ(steps[0].sample, 50);
    EXPECT_LT(std::abs(steps[0].frames - frames), 4.0 * steps[0].sigma);
    EXPECT_NEAR(steps[0].way, 3.14 * kStep_s * std::abs(frames), 0.005);
  }
}

TEST(PathSteps, AreNoneOfASmoothPathOrOfHalfAFrame) {
  EXPECT_TRUE(steps_of(0.0, 1e-3).empty());
  EXPECT_TRUE(steps_of(0.5, 1e-3).empty());
}

// A gap that the times show is no step; a few samples, or a body at rest, show none.
TEST(PathSteps, AreNoneWhereTheTimesShowThemOrNothingMoves) {
  const auto steps_of_places = [](int count, const auto& frame, const auto& shown) {
    std::vector<double> t_s;
    Eigen::MatrixX2d at(count, 2);
    for (int i = 0; i < count; ++i) {
      t_s.push_back(kStep_s * shown(i));
      at.row(i) = place(frame(i));
    }
    return path_steps(t_s, at);
  };
  const auto each = [](int i) { return i; };
  const auto with_gap = [](int i) { return i < 50 ? i : i + 1; };
  EXPECT_FALSE(steps_of_places(100, with_gap, each).empty()) << "else it tests nothing";
  EXPECT_TRUE(steps_of_places(100, with_gap, with_gap).empty());
  EXPECT_TRUE(steps_of_places(12, each, each).empty());
  EXPECT_TRUE(steps_of_places(0, each, each).empty());
  EXPECT_TRUE(steps_of_places(
                  60, [](int) { return 0; }, each)
                  .empty());
}

// By a third of a frame: here and there it looks like a picture that came twice.
TEST(PathSteps, AreNotClearWhereTimesJitter) {
  std::mt19937 generator(1);
  std::normal_distribution<double> jitter(0.0, 0.3);
  std::vector<double> t_s;
  Eigen::MatrixX2d at(4000, 2);
  for (int i = 0; i < 4000; ++i) {
    t_s.push_back(kStep_s * i);
    at.row(i) = place(i + jitter(generator));
  }
  EXPECT_FALSE(path_steps(t_s, at).empty()) << "else it tests nothing";
  EXPECT_TRUE(clear_path_steps(t_s, at, 0.1, 0.0).empty());
}

}  // namespace
}  // namespace trochoid::data
