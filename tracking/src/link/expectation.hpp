#pragma once
#include <algorithm>
#include <cstddef>
#include <optional>
#include <vector>

#include "link/glimpse.hpp"

namespace trochoid::tracking {

/// Frames in which the fit has clearly less support than in those around: it may have settled
/// beside the body.
[[nodiscard]] std::vector<bool> poor_fits(const std::vector<Glimpse>& glimpses);

/// Where the frames around one put the body in it.
struct Expected {
  Sighting seen;            ///< placed there
  data::Pose<> earlier;     ///< one frame before
  double spread_rad = 0.0;  ///< by how much the frames around usually differ on it

  /// Whether they cannot all be wrong about what was seen this far off.
  /// @param least_rad no contradiction if they agree perfectly.
  [[nodiscard]] bool contradicts(double off_rad, double least_rad) const {
    constexpr double kSpreads = 2.0;
    return off_rad >= least_rad + kSpreads * spread_rad;
  }
  [[nodiscard]] bool same_as(const Expected& other) const;
};

/// How far a sighting is from a pose: in the attitude of the axis, or in place per size of the
/// body.
[[nodiscard]] double off_rad(const Sighting& seen, const Sighting& expected, bool alike);

/// What most of the pairs of frames around frame i agree on: some of these may be wrong themselves.
/// @param but frames that do not count.
[[nodiscard]] std::optional<Expected> expected_at(const BodyFinder& finder,
                                                  const std::vector<Glimpse>& glimpses,
                                                  std::size_t i, const std::vector<bool>& but);

/// How far frames usually are from what those around them expect: where that is little, less is a
/// contradiction.
class UsualMiss {
 public:
  UsualMiss(const BodyFinder& finder, const std::vector<Glimpse>& glimpses);
  /// So far off a frame is measured again, or doubted.
  [[nodiscard]] double suspicious_rad() const {
    constexpr double kUsuals = 5.0, kLeast_rad = 0.04;
    return std::clamp(kUsuals * off_rad_, kLeast_rad, kMost_rad);
  }
  /// By which the likelihood of being so far off falls.
  [[nodiscard]] double scatter_rad() const {
    constexpr double kUsuals = 4.0, kLeast_rad = 0.03, kMostScatter_rad = 0.15;
    return std::clamp(kUsuals * off_rad_, kLeast_rad, kMostScatter_rad);
  }
  /// However much frames scatter, so far off is a contradiction.
  static constexpr double kMost_rad = 0.2;

 private:
  double off_rad_ = kMost_rad;
};

/// Where the frames right after frame i (side 1) or right before it (side -1) lead; nothing if the
/// body was not seen in all of them.
[[nodiscard]] std::optional<Sighting> led_to(const BodyFinder& finder,
                                             const std::vector<Glimpse>& glimpses, std::size_t i,
                                             int side);

/// Whether the frames right before frame i or those right after it lead to what was seen in it: it
/// may be where the body was knocked, which none on the other side can know.
[[nodiscard]] bool is_led_to(const BodyFinder& finder, const std::vector<Glimpse>& glimpses,
                             std::size_t i, double within_rad);

}  // namespace trochoid::tracking
