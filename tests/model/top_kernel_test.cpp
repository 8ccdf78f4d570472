#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "top_dispatch.hpp"
#include "trochoid/model/events.hpp"

namespace trochoid::model {
namespace {

/// A run of a random top with room for what it writes.
struct Recorded {
  std::vector<double> t_s, xy, columns[kTopVariables];
  TopResult result;

  Recorded(InstructionSet set, TopRun run, int outputs) : xy(2 * outputs) {
    for (int n = 0; n < outputs; ++n)
      t_s.push_back(run.start_s + (run.end_s - run.start_s) * n / (outputs - 1.0));
    t_s.back() = run.end_s;
    run.t_s = t_s.data();
    run.count = outputs;
    run.with_derivatives = true;
    result.path.l_m = 0.1;
    result.path.xy = xy.data();
    for (int lane = 0; lane < kTopVariables; ++lane) {
      columns[lane].resize(2 * outputs);
      result.path.by_variable[lane] = columns[lane].data();
    }
    run_top_on(set, run, result);
  }
};

TopRun random_top(std::mt19937_64& random, bool drag) {
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  TopRun run;
  const double b = std::exp(3.0 * unit(random));
  const double variables[kTopVariables] = {b * b * unit(random),
                                           b,
                                           drag ? 0.05 * b * unit(random) : 0.0,
                                           drag ? 0.02 * b : 0.0,
                                           0.2 + 2.0 * unit(random),
                                           b * (unit(random) - 0.5),
                                           b * (unit(random) - 0.5)};
  for (int i = 0; i < kTopVariables; ++i) run.variable[i] = variables[i];
  run.phi_rad = 6.0 * unit(random);
  run.drag = drag;
  run.end_s = 20.0 / b;
  run.tolerance = 1e-12;
  return run;
}

// The copies differ in fused multiply-adds only. Rounding differences of 1e-16 grow by the motion's
// own sensitivity over three nutations, at most some 1e3 in value and derivative.
TEST(TopKernel, EveryInstructionSetGivesTheSameNumbers) {
  for (const InstructionSet set : {InstructionSet::avx2, InstructionSet::avx512}) {
    if (!available(set)) continue;
    for (unsigned seed = 1; seed <= 20; ++seed) {
      std::mt19937_64 random(seed);
      const TopRun run = random_top(random, seed % 2 == 0);
      // 101 outputs: steps cover numbers of them that are not multiples of eight.
      const Recorded a(InstructionSet::baseline, run, 101), b(set, run, 101);
      ASSERT_EQ(a.result.written, 101);
      ASSERT_EQ(b.result.written, 101);
      for (std::size_t n = 0; n < a.xy.size(); ++n) {
        ASSERT_NEAR(a.xy[n], b.xy[n], 1e-13) << "seed " << seed;
        for (int lane = 0; lane < kTopVariables; ++lane) {
          const double size = 1.0 + std::abs(a.columns[lane][n]);
          ASSERT_NEAR(a.columns[lane][n], b.columns[lane][n], 1e-11 * size)
              << "seed " << seed << " lane " << lane;
        }
      }
    }
  }
}

TEST(TopKernel, SeriesAndRungeKuttaAgree) {
  constexpr double kAllowed = 1e-8;  // local errors of two methods over some hundred steps
  for (unsigned seed = 1; seed <= 20; ++seed) {
    std::mt19937_64 random(seed);
    TopRun run = random_top(random, seed % 2 == 0);
    run.with_angles = true;
    TopResult series, runge_kutta;
    run_top_here(run, series);
    run_top_dop853(run, runge_kutta);
    ASSERT_EQ(series.end_reason, static_cast<int>(RunEnd::reached_end));
    for (int i = 0; i < kTopEndValues; ++i) {
      EXPECT_NEAR(series.end[i], runge_kutta.end[i], kAllowed * (1.0 + std::abs(series.end[i])))
          << "seed " << seed << " value " << i;
    }
  }
}

TEST(TopKernel, StopsAtTheStepLimitAndSaysHowFarItCame) {
  std::mt19937_64 random(1);
  TopRun run = random_top(random, false);
  run.max_steps = 3;
  const Recorded stopped(widest(), run, 101);
  EXPECT_EQ(stopped.result.end_reason, static_cast<int>(RunEnd::step_limit));
  EXPECT_LT(stopped.result.written, 101);
  EXPECT_LT(stopped.result.reached_s, run.end_s);
  EXPECT_GT(stopped.result.reached_s, 0.0);
}

}  // namespace
}  // namespace trochoid::model
