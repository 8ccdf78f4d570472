#pragma once
#include <Eigen/Core>

#include "trochoid/data/pose.hpp"

namespace trochoid::tracking {

/// How the pose of a body changed from one moment to another, and where it leads if that goes on:
/// what all do who need a pose beyond those that were seen. Three parts go on each by itself:
///   axis    tilt and precession at their rates; so near the vertical that precession means nothing
///           (either pose is steep), along the chord between the two axes instead;
///   centre  straight on, or with a velocity that turns with the precession;
///   spin    not at all: it is read anew in every picture.
/// The support is not enforced: data::PoseMotion::settled.
class PoseChange {
 public:
  using Pose = data::Pose<>;
  /// Whether the centre goes straight on, as that of a body that slides, or turns its velocity with
  /// the precession, as whatever rolls on its rim does. A steep body's goes straight on.
  enum class Centre { straight, turning };

  /// Sine of the tilt below which a body is steep. Whoever follows a body beyond what was seen
  /// carries on what the axis is wrong by: kBeyond. Over part of an exposure that is less: kWithin.
  /// One frame off a pose that was measured, where only how far it smears is asked, the rates are
  /// better than the chord however steep it is: kBeside. By one limit for all, CoM and tilt of a
  /// blurred, wobbling coin were worse.
  static constexpr double kBeyond = 0.2, kWithin = 0.1, kBeside = 0.0;

  /// @param from, to of one face: nearer_face.
  PoseChange(const Pose& from, const Pose& to, double least_sine = kBeyond);
  /// From before over `now` to after, the mean of both halves.
  PoseChange(const Pose& before, const Pose& now, const Pose& after, double least_sine);

  /// `pose`, which is `to` or near it, `share` of the change further on; back where share < 0: -1
  /// leads from `to` to `from`. The tilt stays within 0..pi: an axis that would pass the vertical
  /// stops there.
  [[nodiscard]] Pose on(const Pose& pose, double share, Centre centre = Centre::straight) const;

  /// The parts, for whoever has reason to know which of two holds: the axis, steep or not, along
  /// its chord, and at the rates of tilt and precession; the way of the centre.
  [[nodiscard]] Eigen::Vector3d axis_straight_on(const Pose& pose, double share) const;
  [[nodiscard]] Eigen::Vector3d axis_turning_on(const Pose& pose, double share) const;
  [[nodiscard]] Eigen::Vector3d shift_m(double share, Centre centre) const;

 private:
  double tilt_rad_, precession_rad_;
  Eigen::Vector3d axis_, shift_m_;
  bool steep_;
};

/// Whether a body's axis is so near the vertical that precession means nothing: within the sine of
/// about 12 degrees, where an error of a degree turns it by five.
[[nodiscard]] bool is_steep(const data::Pose<>& pose);

/// Of the two attitudes in which a body with equal faces looks the same, the one whose axis is
/// nearer to a reference. @param mark_rad angle of its spin mark in the body.
[[nodiscard]] data::Pose<> nearer_face(const data::Pose<>& pose, const data::Pose<>& reference,
                                       double mark_rad);

}  // namespace trochoid::tracking
