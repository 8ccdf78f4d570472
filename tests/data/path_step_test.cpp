#include "trochoid/data/path_step.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace trochoid::data {
namespace {

// A point on a circle that drifts, seen with noise.
struct Path {
  std::vector<double> t_s;
  Eigen::MatrixX2d at{0, 2};
  std::mt19937_64 generator{4};
  void add(double shown_s, double true_s) {
    std::normal_distribution<double> normal(0.0, 0.02);
    t_s.push_back(shown_s);
    at.conservativeResize(at.rows() + 1, Eigen::NoChange);
    at.bottomRows<1>() << 40.0 * std::cos(9.0 * true_s) + normal(generator),
        40.0 * std::sin(9.0 * true_s) + 25.0 * true_s + normal(generator);
  }
};

constexpr double kStep_s = 0.01;

// Of each: from which sample on, by how many steps.
Path path_with(const std::vector<std::pair<int, double>>& steps) {
  Path path;
  for (int i = 0; i < 200; ++i) {
    double true_s = kStep_s * i;
    for (const auto& [from, frames] : steps)
      if (i >= from) true_s += kStep_s * frames;
    path.add(kStep_s * i, true_s);
  }
  return path;
}

TEST(PathSteps, AreFoundWhereTheyAreByHowManyFrames) {
  const Path path = path_with({{60, 1.0}, {120, -1.0}, {160, 2.0}});
  const auto steps = path_steps(path.t_s, path.at);
  ASSERT_EQ(steps.size(), 3u);
  for (const auto& [step, sample, frames] :
       {std::tuple(steps[0], 60, 1.0), {steps[1], 120, -1.0}, {steps[2], 160, 2.0}}) {
    EXPECT_EQ(step.sample, sample);
    EXPECT_NEAR(step.frames, frames, 4.0 * step.sigma);
    EXPECT_LT(step.sigma, 0.1);
  }
  EXPECT_TRUE(words_of(steps, path.t_s).starts_with("1.0"));
}

TEST(PathSteps, AreNoneOfASmoothPathNorOfHalfAFrame) {
  EXPECT_TRUE(path_steps(path_with({}).t_s, path_with({}).at).empty());
  const Path half = path_with({{100, 0.5}});
  EXPECT_TRUE(path_steps(half.t_s, half.at).empty());
}

// A gap that the times show is none, nor is a few samples' path or one that stands still.
TEST(PathSteps, AreNoneWhereTheTimesShowThem) {
  Path gap, few, still;
  for (int i = 0; i < 100; ++i) gap.add(kStep_s * (i + (i >= 50)), kStep_s * (i + (i >= 50)));
  for (int i = 0; i < 12; ++i) few.add(kStep_s * i, kStep_s * i);
  for (int i = 0; i < 60; ++i) still.add(kStep_s * i, 0.0);
  for (const Path& path : {gap, few, still, Path{}})
    EXPECT_TRUE(path_steps(path.t_s, path.at).empty());
}

}  // namespace
}  // namespace trochoid::data
