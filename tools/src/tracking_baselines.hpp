#pragma once
#include <filesystem>
#include <vector>

namespace trochoid::tools {

/// Runs what people usually do with OpenCV on a recording (MOG2 background subtraction + moments of
/// the largest blob; HoughCircles; Otsu's threshold + moments) and prints error and speed of each.
/// @param truth  truth.csv, or empty.  @param labels  reference_*.csv, each scored alone.
void print_baselines(const std::filesystem::path& video, const std::filesystem::path& truth,
                     const std::vector<std::filesystem::path>& labels);

}  // namespace trochoid::tools
