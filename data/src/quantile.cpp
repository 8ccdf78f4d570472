#include "trochoid/data/quantile.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace trochoid::data {

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const double place = share * static_cast<double>(values.size() - 1);
  const auto low = values.begin() + static_cast<std::ptrdiff_t>(std::floor(place));
  std::nth_element(values.begin(), low, values.end());
  const double rest = place - std::floor(place);
  return rest > 0.0 ? std::lerp(*low, *std::min_element(low + 1, values.end()), rest) : *low;
}

double upper_median(std::vector<double> values) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double median(std::vector<double> values) {
  return quantile(std::move(values), 0.5);
}

double student_factor(double degrees_of_freedom) {
  constexpr double z = 1.959963984540054;
  const double n = degrees_of_freedom;
  const double first = (z * z + 1.0) / 4.0;
  const double second = (5.0 * std::pow(z, 4) + 16.0 * z * z + 3.0) / 96.0;
  const double third = (3.0 * std::pow(z, 6) + 19.0 * std::pow(z, 4) + 17.0 * z * z - 15.0) / 384.0;
  return 1.0 + (first + (second + third / n) / n) / n;
}

double usual_step_s(const std::vector<double>& t_s) {
  if (t_s.size() < 2) return 0.0;
  std::vector<double> steps_s;
  for (std::size_t i = 1; i < t_s.size(); ++i) steps_s.push_back(t_s[i] - t_s[i - 1]);
  return median(std::move(steps_s));
}

}  // namespace trochoid::data
