#pragma once
#include <filesystem>
#include <string>

#include "trochoid/data/scene.hpp"

namespace trochoid::data {

/// A trajectory to check models against, described by <name>.json beside <name>.csv: the scene it
/// poses, and its time grid. Parameter names: docs/formats.md.
struct ReferenceCase {
  std::string name;
  std::string rung;  ///< "M0" .. "M6"
  Scene scene;       ///< run.until_s and run.rate_hz are the grid
};

/// Reads the JSON. Which law: M5 and M6 take "initial.velocity" = "rolling" for no slip throughout,
/// eps_v > 0 for regularised sliding, and the exact Coulomb law otherwise; coefficients that are 0
/// leave their term out.
/// @throws InputError naming file and key.
[[nodiscard]] ReferenceCase read_reference_case(const std::filesystem::path& json);

}  // namespace trochoid::data
