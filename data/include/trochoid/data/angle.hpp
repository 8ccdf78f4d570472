#pragma once
#include <cmath>
#include <numbers>

namespace trochoid::data {

inline constexpr double kPi = std::numbers::pi;
inline constexpr double kTurn = 2.0 * kPi;  ///< one turn, in rad

/// @param angle_deg in degrees @returns the same in rad
constexpr double radians(double angle_deg) {
  return angle_deg * kPi / 180.0;
}
/// @param angle_rad in rad @returns the same in degrees
constexpr double degrees(double angle_rad) {
  return angle_rad * 180.0 / kPi;
}
/// @param angle_rad in rad @returns the same within half a turn of 0
inline double wrapped(double angle_rad) {
  return std::remainder(angle_rad, kTurn);
}

}  // namespace trochoid::data
