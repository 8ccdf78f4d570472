#pragma once
#include <filesystem>

#include "trochoid/data/table.hpp"

namespace trochoid::tools {

/// @throws InputError unless the name ends in .mp4: asked before the run, not after it.
void check_animation_name(const std::filesystem::path& path);

/// @throws InputError if the trajectory has no path: before anything is written.
void check_has_path(const data::Table& trajectory, const std::filesystem::path& path);

/// Short clip of the CoM drawing its path, seen from above with x to the right and y up (the
/// thesis' comet plot): a bright head, a fading tail and the path so far. 30 frames per second;
/// the run is shown in at most 20 s.
/// @throws InputError if the trajectory has no path or the clip cannot be encoded.
void write_animation(const data::Table& trajectory, const std::filesystem::path& path);

}  // namespace trochoid::tools
