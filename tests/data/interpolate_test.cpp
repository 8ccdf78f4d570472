#include "trochoid/data/interpolate.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <array>

namespace trochoid::data {
namespace {

constexpr std::array<double, 4> kTimes{-1.0, 0.5, 2.0, 2.25};

TEST(PolynomialAt, IsTheCubicThroughFourOfItsValues) {
  const auto cubic = [](double t) { return ((2.0 * t - 3.0) * t + 0.5) * t - 7.0; };
  std::array<double, 4> values{};
  for (std::size_t k = 0; k < values.size(); ++k) values[k] = cubic(kTimes[k]);
  for (const double t : {-2.0, -1.0, 0.0, 1.3, 2.25, 5.0})
    EXPECT_NEAR(polynomial_at<double>(kTimes, values, t), cubic(t), 1e-11) << t;
}

TEST(PolynomialAt, TakesPlacesAsWellAsNumbers) {
  std::array<Eigen::Vector2d, 4> places;
  for (std::size_t k = 0; k < places.size(); ++k)
    places[k] = {3.0 * kTimes[k], kTimes[k] * kTimes[k]};
  const Eigen::Vector2d there = polynomial_at<Eigen::Vector2d>(kTimes, places, 1.5);
  EXPECT_NEAR(there.x(), 4.5, 1e-12);
  EXPECT_NEAR(there.y(), 2.25, 1e-12);
}

TEST(PolynomialAt, IsTheOneValueThereIs) {
  constexpr std::array<double, 1> time{4.0}, value{-2.0};
  EXPECT_EQ(polynomial_at<double>(time, value, 100.0), -2.0);
}

}  // namespace
}  // namespace trochoid::data
