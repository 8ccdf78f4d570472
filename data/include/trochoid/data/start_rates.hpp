#pragma once
#include <optional>
#include <utility>

#include "trochoid/data/scene.hpp"

namespace trochoid::data {

/// Two keys under [start] that are both given and say the same thing, as {"w1_rad_s",
/// "dtheta_rad_s"} do; nothing where each rate goes by one name.
[[nodiscard]] std::optional<std::pair<const char*, const char*>> rate_named_twice(
    const StartSettings& start);

}  // namespace trochoid::data
