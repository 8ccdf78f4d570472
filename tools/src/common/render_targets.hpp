#pragma once
#include <filesystem>

namespace trochoid::tools {

/// Where a made recording goes: clip.mp4 with clip.truth.csv, clip.camera.json and
/// clip.object.json, or in a folder video.mp4, truth.csv, camera.json and object.json.
struct RenderTargets {
  std::filesystem::path video, truth, camera, object;
};

/// Whether an output is named as a folder is, without an extension.
[[nodiscard]] bool named_as_folder(const std::filesystem::path& output);

[[nodiscard]] RenderTargets targets_in(const std::filesystem::path& folder, bool lossless);

/// @throws InputError for a file that is no .mkv or, where it may lose something, .mp4
[[nodiscard]] RenderTargets targets_of(const std::filesystem::path& output, bool lossless);

/// What was filmed is not to be had again. What was rendered has its truth beside it.
/// @throws InputError for files that are there without a truth
void check_not_filmed(const RenderTargets& targets);

/// The outermost folder that is to be made for an output; empty if there is none.
[[nodiscard]] std::filesystem::path folder_to_make(std::filesystem::path output);

}  // namespace trochoid::tools
