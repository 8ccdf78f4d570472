#include "trochoid/data/quantile.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>

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

// Tables of Student's distribution have its 97.5 % quantile with three digits behind the point.
TEST(StudentFactor, IsWhatTablesSay) {
  constexpr double kNormal = 1.95996, kTabulated = 0.001;
  for (const auto& [degrees, quantile] :
       {std::pair(4.0, 2.776), {6.0, 2.447}, {10.0, 2.228}, {30.0, 2.042}, {100.0, 1.984}}) {
    // The series breaks off: what is left falls with the fourth power.
    const double cut_off = 4.0 * std::pow(degrees, -4.0);
    EXPECT_NEAR(student_factor(degrees) * kNormal, quantile, kTabulated + cut_off) << degrees;
  }
  constexpr double kSaid = 0.035;
  EXPECT_NEAR(student_factor(2.0) * kNormal, 4.303, kSaid * 4.303);
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
