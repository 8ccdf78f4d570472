#pragma once
#include <optional>
#include <vector>

namespace trochoid::data {

/// disc and ring: a right circular cylinder (with a bore); top: no shape, only moments about a
/// pivot.
enum class BodyKind { disc, ring, top };

/// A dot painted on a face, the only thing on an axisymmetric body that shows its spin.
struct SpinMark {
  double distance_m = 0.0;    ///< from the symmetry axis to the centre of the dot, >= 0
  double size_m = 0.0;        ///< radius of the dot, > 0
  double angle_rad = 0.0;     ///< direction of the dot in the body, from body x; psi turns it
  bool on_upper_face = true;  ///< the face the symmetry axis k points out of
  bool on_lower_face = false;
  friend bool operator==(const SpinMark&, const SpinMark&) = default;
};

/// Shape and mass of the filmed body: no physics. Lengths in metres, unset values are unknown.
/// The symmetry axis is body z (k); `thickness_m` is the whole height along it.
struct Body {
  BodyKind kind = BodyKind::disc;
  double radius_m = 0.0;        ///< outer rim, > 0 unless kind == top
  double inner_radius_m = 0.0;  ///< bore of a ring, 0 <= inner <= radius (equal: a thin hoop)
  double thickness_m = 0.0;     ///< >= 0
  /// Where a border of another look begins on the faces (a coin's raised rim, a ring of print),
  /// inner_radius_m < border < radius_m; 0 = none. Physics does not know it.
  double border_radius_m = 0.0;
  double axle_radius_m = 0.0;  ///< thin axle along k (tops), 0 = none
  double axle_above_m = 0.0;   ///< how far the axle sticks out of the upper face
  std::optional<double> mass_kg;
  std::optional<double> I_kg_m2;   ///< transverse moment; of tops about the pivot, else the CoM
  std::optional<double> Is_kg_m2;  ///< axial moment
  std::optional<double> l_m;       ///< pivot to CoM along k (tops)
  std::vector<SpinMark> marks;

  [[nodiscard]] double half_thickness_m() const { return 0.5 * thickness_m; }
  /// No mark and two equal faces: (theta, phi) and (pi - theta, phi + pi) look the same.
  [[nodiscard]] bool faces_look_alike() const;
  friend bool operator==(const Body&, const Body&) = default;
};

}  // namespace trochoid::data
