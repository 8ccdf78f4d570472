#pragma once
#include <filesystem>
#include <string>

namespace trochoid::tools {

/// What is made of a recording is named after it: "ring" of ring.mp4 and of the folder ring/; of a
/// series (ring/%04d.png) or a pattern (ring/*.png) after the folder of its pictures.
[[nodiscard]] std::string recording_name(const std::filesystem::path& recording);

}  // namespace trochoid::tools
