#pragma once
#include <filesystem>
#include <vector>

#include "draw/plot.hpp"

namespace trochoid::tools {

/// Tracks each recording (video.mp4, truth.csv, camera.json, object.json) at every effort, at
/// several resolutions and cut to where the body goes, each in a process of its own, prints error
/// against frames per second and writes chain_tracking.csv into `out`. Smaller pictures are made by
/// ffmpeg, area-averaged.
/// @returns the diagram. @throws InputError for a folder that lacks one of the files.
[[nodiscard]] Axes study_tracking_chain(const std::vector<std::filesystem::path>& folders,
                                        const std::filesystem::path& out);

}  // namespace trochoid::tools
