#include "study/solver_bars.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "trochoid/data/error.hpp"

namespace trochoid::tools {
namespace {

std::vector<SolverRow> rows_with_adams_at(double time_us) {
  return {{"trochoid", 1e-10, 1e-11, 30.0},
          {"with 7 derivatives", 1e-10, 1e-11, 90.0},
          {"CVODE Adams", 1e-9, 1e-9, 0.1 * time_us},
          {"CVODE Adams", 1e-12, 1e-11, time_us}};
}

TEST(SolverBars, SayWhichIsHeldAndWhichIsNot) {
  const auto held = solver_bars(rows_with_adams_at(61.0 * 30.0));
  const auto missed = solver_bars(rows_with_adams_at(59.0 * 30.0));
  ASSERT_EQ(held.size(), 5U);
  EXPECT_TRUE(held[0].held());
  EXPECT_FALSE(missed[0].held());
  EXPECT_NEAR(held[3].measured, 3.0, 1e-12);  // derivatives: 90 us over 30
  EXPECT_TRUE(held[3].held());
  EXPECT_TRUE(held[4].held());
}

TEST(SolverBars, AProgramThatIsNotInstalledHoldsNothing) {
  const auto bars = solver_bars(rows_with_adams_at(1e4));
  EXPECT_TRUE(std::isnan(bars[1].measured));
  EXPECT_FALSE(bars[1].held());
}

TEST(SolverBars, CompareAtEqualError) {
  // On double logarithmic paper: 1e-10 is half way from 1e-9 (10 us) to 1e-11 (1000 us).
  const std::vector<SolverRow> rows{{"other", 1e-8, 1e-9, 10.0}, {"other", 1e-10, 1e-11, 1000.0}};
  EXPECT_NEAR(time_at_error_us(rows, "other", 1e-10), 100.0, 1e-9);
  EXPECT_NEAR(time_at_error_us(rows, "other", 1e-13), 1000.0, 1e-9);
  EXPECT_NEAR(time_at_error_us(rows, "other", 1e-5), 10.0, 1e-9);
  EXPECT_TRUE(std::isnan(time_at_error_us(rows, "nobody", 1e-10)));
}

TEST(SolverBars, NeedTheRowTheyAreMeasuredBy) {
  EXPECT_THROW((void)solver_bars({}), NumericalError);
}

}  // namespace
}  // namespace trochoid::tools
