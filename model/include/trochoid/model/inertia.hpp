#pragma once
#include "trochoid/data/body.hpp"

namespace trochoid::model {

/// Mass and principal moments about the centre of mass. With an unknown mass everything is per
/// kilogram of body (mass_kg = 1), which is all that a rolling or sliding body without air needs:
/// its mass drops out of the motion.
struct CentralInertia {
  double mass_kg = 1.0;
  bool mass_known = false;
  double transverse_kg_m2 = 0.0;  ///< A, about any diameter
  double axial_kg_m2 = 0.0;       ///< C, about the symmetry axis
};

/// Moments of a disc or ring from its shape,
///     A = m (3 (R^2 + Ri^2) + 4 h^2) / 12,   C = m (R^2 + Ri^2) / 2,   h half the thickness,
/// each replaced by Body::I_kg_m2 and Body::Is_kg_m2 where given (these are about the centre).
/// This is the only place where moments are computed.
/// @throws InputError for a top, a radius that is not positive, a given moment without a mass, or
///         moments no body has (C > 2 A).
[[nodiscard]] CentralInertia central_inertia(const data::Body& body);

}  // namespace trochoid::model
