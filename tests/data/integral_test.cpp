#include "trochoid/data/integral.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace trochoid::data {
namespace {

// The rule is exact for a straight line, however the times are spaced; halves add without rounding.
TEST(RunningIntegral, OfALineIsItsParabola) {
  const std::vector<double> t{1.0, 1.5, 3.0, 3.5};
  Eigen::VectorXd f(4), parabola(4);
  for (int i = 0; i < 4; ++i) {
    f[i] = 2.0 * t[static_cast<std::size_t>(i)] - 1.0;
    parabola[i] = (f[i] * f[i] - f[0] * f[0]) / 4.0;
  }
  EXPECT_EQ(running_integral(t, f), parabola);
}

TEST(RunningIntegral, OfOneValueIsZero) {
  EXPECT_EQ(running_integral(std::vector{2.0}, Eigen::VectorXd::Constant(1, 5.0))[0], 0.0);
}

}  // namespace
}  // namespace trochoid::data
