#pragma once
#include <filesystem>
#include <vector>

namespace trochoid::tools {

/// Runs what people usually do with OpenCV on a recording (MOG2 background subtraction + moments of
/// the largest blob; HoughCircles; Otsu's threshold + moments; where OpenCV has it the correlation
/// filter KCF, started on the true place) and prints error and speed of each.
/// @param truth  truth.csv, or empty.  @param labels  reference_*.csv, each scored alone.
/// @param radius_px  of the body, about: half the side of a correlation filter's box.
void print_baselines(const std::filesystem::path& video, const std::filesystem::path& truth,
                     const std::vector<std::filesystem::path>& labels, double radius_px);

}  // namespace trochoid::tools
