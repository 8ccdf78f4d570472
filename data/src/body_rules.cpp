#include "body_rules.hpp"

#include <fmt/format.h>

namespace trochoid::data {

std::optional<BodyFault> fault_of(const Body& body, const BodyKeys& keys) {
  if (body.kind == BodyKind::top) return std::nullopt;
  if (body.kind == BodyKind::ring && !(body.inner_radius_m > 0.0))
    return BodyFault{
        keys.inner_radius,
        fmt::format("a ring needs {} > 0; a body without a bore is a disc", keys.inner_radius)};
  if (body.inner_radius_m > body.radius_m)
    return BodyFault{keys.inner_radius,
                     fmt::format("{} = {} must not exceed {} = {}", keys.inner_radius,
                                 body.inner_radius_m, keys.radius, body.radius_m)};
  if (body.border_radius_m > 0.0 &&
      (body.border_radius_m <= body.inner_radius_m || body.border_radius_m >= body.radius_m))
    return BodyFault{keys.border_radius,
                     fmt::format("{} = {} must lie between {} = {} and {} = {}", keys.border_radius,
                                 body.border_radius_m, keys.inner_radius, body.inner_radius_m,
                                 keys.radius, body.radius_m)};
  if (body.axle_radius_m >= body.radius_m)
    return BodyFault{keys.axle_radius,
                     fmt::format("{} = {} must be smaller than {} = {}", keys.axle_radius,
                                 body.axle_radius_m, keys.radius, body.radius_m)};
  for (const SpinMark& mark : body.marks) {
    if (mark.distance_m > body.radius_m)
      return BodyFault{keys.marks,
                       fmt::format("the mark's {} = {} lies outside {} = {}", keys.mark_distance,
                                   mark.distance_m, keys.radius, body.radius_m)};
    if (mark.distance_m + mark.size_m <= body.inner_radius_m)
      return BodyFault{
          keys.marks,
          fmt::format("the mark's {} = {} puts all of it into the bore of {} = {}",
                      keys.mark_distance, mark.distance_m, keys.inner_radius, body.inner_radius_m)};
  }
  return std::nullopt;
}

}  // namespace trochoid::data
