#pragma once
#include <array>
#include <optional>
#include <vector>

#include "geometry/outline_samples.hpp"
#include "geometry/pose_change.hpp"

namespace trochoid::tracking {

/// How a body moves while the shutter is open, from what it does between two pictures. A picture is
/// the mean over the exposure: where the outline sweeps over more than its blur, an edge is not a
/// blurred step at the middle position but a ramp, and its half level is not there.
class ExposureMotion {
 public:
  /// @param before the body one frame earlier; @param middle in the middle of the exposure.
  /// @param fraction shutter time over frame interval.
  ExposureMotion(const data::Pose<>& before, const data::Pose<>& middle, double fraction);
  /// Where a body is that is at `middle` half-way; `share` is -1/2 when the shutter opens and 1/2
  /// when it closes; the support is not enforced.
  [[nodiscard]] data::Pose<> at(const data::Pose<>& middle, double share) const;

 private:
  PoseChange change_;  ///< from frame to frame
  double fraction_;
};

/// Where an outline is along the normal of its middle position while the shutter is open: at the
/// middles of `count` equal parts of the exposure.
struct Sweep {
  static constexpr int kMost = 12;
  int count = 0;                         ///< 0: not known, e.g. it leaves the normal
  std::array<double, kMost> shift_px{};  ///< outwards
  [[nodiscard]] double mean_px() const;
  [[nodiscard]] double half_range_px() const;
  /// Length swept during one part: how wide the outline is within it.
  [[nodiscard]] double step_px() const;
};

/// Of a place between those of two sweeps, `part` of the way.
[[nodiscard]] Sweep between(const Sweep& from, const Sweep& to, double part);

/// Outlines at the middles of so many equal parts of the exposure, each row's its own.
using Moments = std::vector<std::vector<OutlineSample>>;
[[nodiscard]] Moments moments_of(const data::Body& body, const data::Camera& camera,
                                 const data::PoseMotion& motion, const ExposureMotion& exposure,
                                 const data::Pose<>& middle, int parts,
                                 const MotionInReadout& in_readout = {});

/// Sweeps of all samples of the outline in the middle, each within as many parts as there are
/// moments, at most Sweep::kMost.
[[nodiscard]] std::vector<Sweep> sweeps_of(const Moments& moments,
                                           const std::vector<OutlineSample>& outline);

}  // namespace trochoid::tracking
