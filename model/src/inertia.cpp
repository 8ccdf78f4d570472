#include "trochoid/model/inertia.hpp"

#include <fmt/format.h>

#include <cmath>

#include "trochoid/data/error.hpp"

namespace trochoid::model {
namespace {

void require_positive(double value, const char* field) {
  if (!(std::isfinite(value) && value > 0.0))
    throw InputError(fmt::format("body.{} = {} must be greater than 0", field, value));
}

void check_shape(const data::Body& body) {
  if (body.kind == data::BodyKind::top)
    throw InputError(
        "body.kind = \"top\" has no rim: models with contact need a disc or ring with radius_m");
  require_positive(body.radius_m, "radius_m");
  if (!(body.thickness_m >= 0.0))
    throw InputError(fmt::format("body.thickness_m = {} must be 0 or greater", body.thickness_m));
  if (!(body.inner_radius_m >= 0.0 && body.inner_radius_m <= body.radius_m))
    throw InputError(fmt::format("body.inner_radius_m = {} must lie between 0 and radius_m = {}",
                                 body.inner_radius_m, body.radius_m));
  if (body.mass_kg) require_positive(*body.mass_kg, "mass_kg");
}

}  // namespace

CentralInertia central_inertia(const data::Body& body) {
  check_shape(body);
  if ((body.I_kg_m2 || body.Is_kg_m2) && !body.mass_kg)
    throw InputError(
        "body.mass_kg is missing: moments given in kg m^2 (I_kg_m2, Is_kg_m2) need the mass");
  CentralInertia inertia;
  inertia.mass_known = body.mass_kg.has_value();
  inertia.mass_kg = body.mass_kg.value_or(1.0);
  const double m = inertia.mass_kg, h = body.half_thickness_m();
  const double radii2 = body.radius_m * body.radius_m + body.inner_radius_m * body.inner_radius_m;
  inertia.transverse_kg_m2 = body.I_kg_m2.value_or(m * (3.0 * radii2 + 4.0 * h * h) / 12.0);
  inertia.axial_kg_m2 = body.Is_kg_m2.value_or(m * radii2 / 2.0);
  require_positive(inertia.transverse_kg_m2, "I_kg_m2");
  require_positive(inertia.axial_kg_m2, "Is_kg_m2");
  // Equality is a flat body; the slack is for moments written with few digits.
  constexpr double kSlack = 1e-3;
  if (inertia.axial_kg_m2 > 2.0 * inertia.transverse_kg_m2 * (1.0 + kSlack))
    throw InputError(fmt::format(
        "body.Is_kg_m2 = {} exceeds twice I_kg_m2 = {}: no body has such moments about its centre",
        inertia.axial_kg_m2, inertia.transverse_kg_m2));
  return inertia;
}

}  // namespace trochoid::model
