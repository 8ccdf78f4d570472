#pragma once
#include <array>
#include <memory>
#include <optional>

#include "find/background.hpp"
#include "find/cast_shadow.hpp"
#include "find/contrast.hpp"
#include "find/rim_fit.hpp"
#include "trochoid/tracking/frame_source.hpp"
#include "trochoid/tracking/outline_fit.hpp"

namespace trochoid::tracking {

/// One body in one frame.
struct Sighting {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Zero();
  Ellipse rim;                          ///< about what it covers in the picture
  std::optional<PoseMeasurement> pose;  ///< with known body and camera
  std::optional<double> turned_rad;  ///< of the face since the seed frame, image angle, unwrapped
  double turned_sigma_rad = 0.0;
  double rms_px = 0.0;             ///< of the accepted edges about the outline
  double accepted = 0.0;           ///< fraction 0..1 of the outline with an accepted edge
  bool attitude_doubtful = false;  ///< it may be a mirror image, or a fit that went astray
  /// How far off each of BodyFinder::other_readings is; no covariance holds that.
  std::array<PoseSpread, 2> other_readings{};
  /// FloorDarkening::agrees of its shadow, -2..1: 0 where that is hidden or no lamp is known.
  double shadow = 0.0;
  Contrast contrast{};
  std::vector<EdgePoint> edges;

  /// Compares how well one body is seen in different pictures, 0..about the length of its outline
  /// [px]; needs a pose. A wrong pose may have the longer outline and so the more support: the
  /// fraction of it with an edge counts too.
  [[nodiscard]] double visible_support_px() const { return pose->support_px * accepted; }
};

/// The picture and what is expected in it, for one attempt.
struct Look {
  const Frame& frame;
  const Plate& background;  ///< of the frame's brightness near the body
  std::optional<Detection> detection{};
  const Sighting* predicted = nullptr;
  const Sighting* last = nullptr;  ///< in the frame before, if seen there
  int side_of_last = 1;            ///< -1: it is a later frame, of one who follows back
  double reach_px = 4.0;           ///< how far off the prediction may be
  double shape_sigma_px = 1.0;     ///< how well the predicted rim's shape is known
  Eigen::Vector2d motion_px = Eigen::Vector2d::Zero();  ///< per frame
  const ShadingMemory* shading = nullptr;  ///< light beside the outline in other frames, if known
  bool there = false;  ///< right where it is predicted: nothing farther off is looked for
};

/// Measures one body where it is expected. Stateless: used from several threads.
class BodyFinder {
 public:
  virtual ~BodyFinder() = default;
  /// Nothing if the picture does not show the body there.
  [[nodiscard]] virtual std::optional<Sighting> find(const Look& look) const = 0;
  /// Puts centre and rim of a guessed sighting where its pose, if it has one, would be seen.
  virtual void place(Sighting& guess) const = 0;
  /// The other tilt with nearly the same silhouette, nothing where there is none.
  [[nodiscard]] virtual std::optional<data::Pose<>> mirror_image(
      const data::Pose<>& /*pose*/) const {
    return std::nullopt;
  }
  /// Attitudes of a body that may have been taken for this one, part of its outline for another:
  /// its face for the whole of it, its wall's edge for its face's. Not the mirror image.
  using OtherReadings = std::array<std::optional<data::Pose<>>, 2>;
  [[nodiscard]] virtual OtherReadings other_readings(const data::Pose<>& /*pose*/) const {
    return {};
  }
  /// The floor around the body in some pose; nothing for a body of unknown shape.
  [[nodiscard]] virtual std::optional<FloorDarkening> floor_around(
      const Frame& /*frame*/, const Plate& /*background*/, const data::Pose<>& /*pose*/) const {
    return std::nullopt;
  }
  /// For a body on the floor that is known to lie on its face; null where there is no difference.
  [[nodiscard]] virtual const BodyFinder* lying() const { return nullptr; }
  /// Semi-major axis of the rim of the body lying there [px]; 0 if its size is not known.
  [[nodiscard]] virtual double expected_major_px(const Eigen::Vector2d& /*at_px*/) const {
    return 0.0;
  }
  /// How far from its centre the body's outline may lie, at most [px].
  [[nodiscard]] virtual double reach_px(const Sighting& seen) const {
    return seen.rim.semi_major_px();
  }
  /// Poses (theta, phi) and (pi - theta, phi + pi) show the same picture.
  [[nodiscard]] virtual bool faces_look_alike() const { return false; }
  /// Angle of the spin mark in the body, 0 without one.
  [[nodiscard]] virtual double mark_rad() const { return 0.0; }
};

/// By its rim alone: an ellipse in the picture. For want of a camera or a body.
[[nodiscard]] std::unique_ptr<BodyFinder> make_rim_finder();

/// By the outline of the known cylinder under the known camera.
/// @param exposure_fraction shutter time over frame interval, 0 if unknown.
/// @param readout_per_px OutlineView's.
[[nodiscard]] std::unique_ptr<BodyFinder> make_cylinder_finder(
    const data::Body& body, const data::Support& support, const data::Camera& camera,
    double exposure_fraction, Effort effort = Effort::normal,
    const Eigen::Vector2d& readout_per_px = Eigen::Vector2d::Zero());

}  // namespace trochoid::tracking
