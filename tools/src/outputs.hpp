#pragma once
#include <filesystem>
#include <vector>

namespace trochoid::tools {

/// Called before the work, so that a wrong name costs no time and no recording: `output` must lie
/// in a folder that exists and be none of the files the command reads. Empty paths are skipped.
/// @throws InputError naming the output.
void check_output(const std::filesystem::path& output,
                  const std::vector<std::filesystem::path>& inputs);

}  // namespace trochoid::tools
