#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "trochoid/data/scene.hpp"

namespace trochoid::tools {

/// A scene that comes with the program (data/scenes/NAME.toml, embedded when it is built).
struct BundledScene {
  std::string_view name;
  std::string_view toml;
  [[nodiscard]] std::string_view summary() const;  ///< its first comment line
};
[[nodiscard]] const std::vector<BundledScene>& bundled_scenes();

/// A scene file, or a bundled scene by name.
/// @throws InputError naming the nearest bundled name if it is neither.
[[nodiscard]] data::Scene load_scene(const std::string& file_or_name);

}  // namespace trochoid::tools
