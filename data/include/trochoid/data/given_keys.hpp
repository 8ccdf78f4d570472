#pragma once
#include <string>
#include <vector>

#include "trochoid/data/scene.hpp"

namespace trochoid::data {

/// What a scene says of motion: the keys of [support], [model], [start] and [run] that differ
/// from their defaults, as "model.friction".
[[nodiscard]] std::vector<std::string> given_keys(const Scene& scene);

}  // namespace trochoid::data
