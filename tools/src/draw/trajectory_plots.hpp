#pragma once
#include <filesystem>
#include <string>

#include "trochoid/data/table.hpp"

namespace trochoid::tools {

/// Writes plots of a trajectory into a folder: angles, rates, angular velocity and momentum, path
/// from above and from the side, energy; those whose columns there are.
/// @returns the files written.
std::vector<std::filesystem::path> write_trajectory_plots(const data::Table& trajectory,
                                                          const std::string& title,
                                                          const std::filesystem::path& folder);

}  // namespace trochoid::tools
