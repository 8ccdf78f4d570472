#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "trochoid/data/camera.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/scene.hpp"

namespace trochoid::tools {

/// A scene that comes with the program (data/scenes/NAME.toml, embedded when it is built).
struct BundledScene {
  std::string_view name;
  std::string_view toml;
  [[nodiscard]] std::string_view summary() const;  ///< its first comment line
};
[[nodiscard]] const std::vector<BundledScene>& bundled_scenes();

/// A scene file, or a bundled scene by name, though a folder may be called like it.
/// @throws InputError that tells how to list the bundled ones if it is neither.
[[nodiscard]] data::Scene load_scene(const std::string& file_or_name);

/// Says in one line on stderr which keys of the scene its model passes over, if any.
void tell_idle_keys(const std::string& scene_name, const data::Scene& scene);

/// The camera of the file `given`, else of the file that the scene (called `scene_name`) names, if
/// there is one. @throws InputError that names the file, and the scene if that is where it stands.
[[nodiscard]] std::optional<data::Camera> named_camera(const std::filesystem::path& given,
                                                       const data::Scene& scene,
                                                       const std::string& scene_name);

/// Runs `use`, which is given nothing but the scene and tracks: what it finds wrong is the scene's,
/// and is said with the scene's name (if it has one), unless it says that it is a track's.
template <class Use>
auto in_scene(const std::string& scene, const Use& use) {
  try {
    return use();
  } catch (const TrackError&) {
    throw;
  } catch (const InputError& error) {
    if (scene.empty()) throw;
    throw InputError(scene + ": " + error.what());
  }
}

/// Runs `use`, which is given tracks: what it finds wrong with them is said with their name.
template <class Use>
auto of_tracks(const std::string& names, const Use& use) {
  try {
    return use();
  } catch (const TrackError& error) {
    throw InputError(names + ": " + error.what());
  }
}

}  // namespace trochoid::tools
