#pragma once
#include <optional>
#include <string>

#include "trochoid/data/body.hpp"

namespace trochoid::data {

/// How a file spells the sizes of a body [m], as its messages show them.
struct BodyKeys {
  std::string radius, inner_radius, border_radius, axle_radius;
  std::string marks;          ///< the list of them
  std::string mark_distance;  ///< of one mark
};

/// What is wrong with a body, and the key it is wrong at.
struct BodyFault {
  std::string key, words;
};

/// Sizes that contradict each other, whatever file they come from: a ring without a bore, a bore
/// larger than the rim, a border outside of the face, an axle as wide as the body, a mark beyond
/// the rim or in the bore. A top has no shape.
[[nodiscard]] std::optional<BodyFault> fault_of(const Body& body, const BodyKeys& keys);

}  // namespace trochoid::data
