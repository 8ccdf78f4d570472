#pragma once
#include <limits>

namespace trochoid::tools {

inline constexpr double kMmPerM = 1000.0;
/// Where there is no value.
inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

}  // namespace trochoid::tools
