#include "observe/direction.hpp"

#include <algorithm>
#include <cmath>

namespace trochoid::fitting {

// The predicted direction in the frame of the seen one (theta, phi): a along its meridian, b along
// its parallel, c along itself; primes mark what is predicted.
//   a = cos(theta) sin(theta') cos(phi' - phi) - sin(theta) cos(theta')
//   b = sin(theta') sin(phi' - phi)
//   c = sin(theta) sin(theta') cos(phi' - phi) + cos(theta) cos(theta')
// The great circle between both has the length omega, cos(omega) = c, sin(omega) = |(a, b)|, and
// sets off along (a, b): the way is f (a, b) with f = omega / sin(omega).
Departure departure(const Eigen::Vector2d& seen, const Eigen::Vector2d& predicted,
                    bool ends_alike) {
  const double sine = std::sin(seen[0]), cosine = std::cos(seen[0]);
  const double sine_p = std::sin(predicted[0]), cosine_p = std::cos(predicted[0]);
  const double sine_d = std::sin(predicted[1] - seen[1]),
               cosine_d = std::cos(predicted[1] - seen[1]);
  Eigen::Vector2d ab(cosine * sine_p * cosine_d - sine * cosine_p, sine_p * sine_d);
  double c = sine * sine_p * cosine_d + cosine * cosine_p;
  Eigen::Matrix2d slope;
  slope << cosine * cosine_p * cosine_d + sine * sine_p, -cosine * sine_p * sine_d,
      cosine_p * sine_d, sine_p * cosine_d;
  Eigen::RowVector2d slope_c(sine * cosine_p * cosine_d - cosine * sine_p, -sine * sine_p * sine_d);
  Departure result;
  result.other_face = ends_alike && c < 0.0;
  if (result.other_face) {
    ab = -ab, c = -c;
    slope = -slope, slope_c = -slope_c;
  }
  // All ways lead to the opposite direction: from this angle on the length stays what it is.
  constexpr double kMost = 3.0;  // rad
  const double omega = std::atan2(ab.norm(), c);
  if (omega > kMost) {
    // There every direction is as good as any other, and turns without bounds from one to the next.
    constexpr double kLeastNorm = 1e-3;
    const double norm = ab.norm();
    const Eigen::Vector2d along =
        norm > 0.0 ? Eigen::Vector2d(ab / norm) : Eigen::Vector2d::UnitX();
    result.way = kMost * along;
    result.slope = kMost / std::max(kLeastNorm, norm) *
                   (Eigen::Matrix2d::Identity() - along * along.transpose()) * slope;
    return result;
  }
  double f = 1.0, f_by_c = -1.0 / 3.0;  // limits for omega -> 0
  constexpr double kSmall = 1e-3;
  if (omega > kSmall) {
    const double s = std::sin(omega);
    f = omega / s, f_by_c = (omega * c - s) / (s * s * s);
  }
  result.way = f * ab;
  result.slope = f * slope + f_by_c * ab * slope_c;
  return result;
}

}  // namespace trochoid::fitting
