#include "common/render_targets.hpp"

#include <fmt/format.h>

#include <string>
#include <system_error>

#include "trochoid/data/error.hpp"

namespace trochoid::tools {

namespace fs = std::filesystem;

bool named_as_folder(const fs::path& output) {
  return output.extension().empty();
}

RenderTargets targets_in(const fs::path& folder, bool lossless) {
  return {folder / (lossless ? "video.mkv" : "video.mp4"), folder / "truth.csv",
          folder / "camera.json", folder / "object.json"};
}

RenderTargets targets_of(const fs::path& output, bool lossless) {
  const std::string given = output.extension().string();
  if (!given.empty() && given != ".mkv" && (lossless || given != ".mp4"))
    throw InputError(fmt::format("{}: name {}; a folder with a dot in its name ends in /",
                                 output.string(),
                                 lossless ? "a folder or, as it is to be lossless, a .mkv file"
                                          : "a folder, an .mp4 or an .mkv file"));
  if (named_as_folder(output)) return targets_in(output, lossless);
  const auto beside = [&](const char* name) {
    fs::path path = output;
    return path.replace_extension(name);
  };
  return {output, beside(".truth.csv"), beside(".camera.json"), beside(".object.json")};
}

void check_not_filmed(const RenderTargets& targets) {
  std::error_code ignored;
  if (fs::exists(targets.truth, ignored)) return;
  for (const fs::path& file : {targets.video, targets.camera, targets.object})
    if (fs::exists(file, ignored))
      throw InputError(
          fmt::format("{}: exists and was not rendered, as there is no {}; name another output",
                      file.string(), targets.truth.string()));
}

fs::path folder_to_make(fs::path output) {
  if (!named_as_folder(output)) return {};
  if (!output.has_filename()) output = output.parent_path();
  if (fs::exists(output)) return {};
  while (output.has_parent_path() && !fs::exists(output.parent_path()))
    output = output.parent_path();
  return output;
}

}  // namespace trochoid::tools
