#pragma once
#include <vector>

namespace trochoid::data {

/// The value below which a share (0..1) of the values lies, linear between neighbours in order.
/// NaN without values.
[[nodiscard]] double quantile(std::vector<double> values, double share);

/// The one in the middle; of an even number the mean of the two there. NaN without values.
[[nodiscard]] double median(std::vector<double> values);

/// The one in the middle; of an even number the upper one there, so that it is one of the values.
/// NaN without values.
[[nodiscard]] double upper_median(std::vector<double> values);

}  // namespace trochoid::data
