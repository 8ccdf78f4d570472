#pragma once
#include <functional>
#include <vector>

namespace trochoid::data {

/// The value below which a share (0..1) of the values lies, linear between neighbours in order.
/// NaN without values.
[[nodiscard]] double quantile(std::vector<double> values, double share);

/// The one in the middle; of an even number the mean of the two there. NaN without values.
[[nodiscard]] double median(std::vector<double> values);

/// Standard deviation of normally distributed values over the median of their distances from the
/// middle, 1 / quantile of 3/4.
inline constexpr double kSdOverMedianDistance = 1.4826;

/// By what a standard deviation that was estimated from few residuals is to be multiplied so that
/// two of them hold what they promise: the 97.5 % quantile of Student's distribution over that of
/// the normal one (Abramowitz and Stegun 26.7.5; 3 % too small for two degrees of freedom).
/// @param degrees_of_freedom  > 0
[[nodiscard]] double student_factor(double degrees_of_freedom);

/// Median of the times from each moment to the next [s]; 0 for fewer than two.
[[nodiscard]] double usual_step_s(const std::vector<double>& t_s);

/// The same of anything that has a time. @param time_s gives it: a member or a function [s].
template <class Range, class Time>
[[nodiscard]] double usual_step_s(const Range& moments, const Time& time_s) {
  std::vector<double> t_s;
  for (const auto& moment : moments) t_s.push_back(std::invoke(time_s, moment));
  return usual_step_s(t_s);
}

/// The one in the middle; of an even number the upper one there, so that it is one of the values.
/// NaN without values.
[[nodiscard]] double upper_median(std::vector<double> values);

}  // namespace trochoid::data
