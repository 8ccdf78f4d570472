#include "trochoid/data/body.hpp"

#include <algorithm>
#include <cmath>

#include "trochoid/data/angle.hpp"

namespace trochoid::data {
namespace {

bool same_direction(double a_rad, double b_rad) {
  constexpr double kSameAngle_rad = 1e-6;  // far below what any picture shows
  return std::abs(std::remainder(a_rad - b_rad, kTurn)) < kSameAngle_rad;
}

// Turning the body over about a diameter at `axis_rad` sends a dot at angle a to 2 axis - a.
bool mirrored(const std::vector<SpinMark>& marks, double axis_rad) {
  return std::all_of(marks.begin(), marks.end(), [&](const SpinMark& mark) {
    return std::any_of(marks.begin(), marks.end(), [&](const SpinMark& other) {
      return mark.distance_m == other.distance_m && mark.size_m == other.size_m &&
             mark.on_upper_face == other.on_lower_face &&
             mark.on_lower_face == other.on_upper_face &&
             same_direction(other.angle_rad, 2.0 * axis_rad - mark.angle_rad);
    });
  });
}

}  // namespace

bool Body::faces_look_alike() const {
  if (axle_above_m > 0.0) return false;
  if (marks.empty()) return true;
  return std::any_of(marks.begin(), marks.end(), [&](const SpinMark& other) {
    return mirrored(marks, 0.5 * (marks.front().angle_rad + other.angle_rad));
  });
}

}  // namespace trochoid::data
