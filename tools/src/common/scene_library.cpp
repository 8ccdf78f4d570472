#include "common/scene_library.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>

#include "common/progress.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/model/idle_keys.hpp"

namespace trochoid::tools {

std::string_view BundledScene::summary() const {
  if (!toml.starts_with("# ")) return {};
  return toml.substr(2, toml.find('\n') - 2);
}

data::Scene load_scene(const std::string& file_or_name) {
  std::error_code ignored;  // of what cannot be looked at reading tells more
  const bool folder = std::filesystem::is_directory(file_or_name, ignored);
  if (!folder && std::filesystem::exists(file_or_name)) return data::read_scene(file_or_name);
  const auto& scenes = bundled_scenes();
  const auto found = std::find_if(scenes.begin(), scenes.end(), [&](const BundledScene& scene) {
    return scene.name == file_or_name;
  });
  if (found != scenes.end())
    return data::parse_scene(std::string(found->toml), std::string(found->name));
  throw InputError(fmt::format(
      "{}: neither a scene file nor a bundled scene; `trochoid simulate --list` names those",
      file_or_name));
}

std::optional<data::Camera> named_camera(const std::filesystem::path& given,
                                         const data::Scene& scene, const std::string& scene_name) {
  if (!given.empty()) return data::read_camera(given);
  if (scene.camera.file.empty()) return std::nullopt;
  return in_scene(scene_name, [&] { return data::read_camera(scene.camera.file); });
}

void tell_idle_keys(const std::string& scene_name, const data::Scene& scene) {
  const std::vector<std::string> idle = model::idle_keys(scene);
  if (idle.empty()) return;
  note(fmt::format("{}: the model has no use for {}, which count{} for nothing", scene_name,
                   fmt::join(idle, ", "), idle.size() == 1 ? "s" : ""));
}

}  // namespace trochoid::tools
