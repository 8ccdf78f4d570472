#include "trochoid/data/quantile.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace trochoid::data {
namespace {

TEST(Quantile, LiesBetweenNeighboursInOrder) {
  const std::vector<double> values{3.0, 1.0, 4.0, 2.0};
  EXPECT_DOUBLE_EQ(quantile(values, 0.0), 1.0);
  EXPECT_DOUBLE_EQ(quantile(values, 0.5), 2.5);
  EXPECT_DOUBLE_EQ(quantile(values, 0.9), 3.7);
  EXPECT_DOUBLE_EQ(quantile(values, 1.0), 4.0);
  EXPECT_DOUBLE_EQ(median({7.0, 5.0, 6.0}), 6.0);
  EXPECT_DOUBLE_EQ(median(values), 2.5);
  EXPECT_DOUBLE_EQ(upper_median(values), 3.0);
  EXPECT_DOUBLE_EQ(upper_median({7.0, 5.0, 6.0}), 6.0);
}

TEST(Quantile, OfNothingIsNotANumber) {
  EXPECT_TRUE(std::isnan(median({})));
  EXPECT_TRUE(std::isnan(upper_median({})));
}

TEST(UsualStep, IsTheMedianOfTheTimesBetweenWhateverHasThem) {
  struct Seen {
    double t_s;
  };
  EXPECT_DOUBLE_EQ(usual_step_s({0.0, 0.5, 1.0, 4.0}), 0.5);
  EXPECT_DOUBLE_EQ(usual_step_s(std::vector<Seen>{{0.0}, {0.5}, {1.0}, {4.0}}, &Seen::t_s), 0.5);
  EXPECT_EQ(usual_step_s({3.0}), 0.0);
}

}  // namespace
}  // namespace trochoid::data
