#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "report/report.hpp"

namespace trochoid::tools {

/// Before the work of a run. @throws InputError if the folder is something a run did not make, or
/// holds something else or one of the files that are read: it is replaced.
void check_replaceable(const std::filesystem::path& folder,
                       const std::vector<std::filesystem::path>& inputs);

/// File of a run's folder that marks it as ours and tells what the other files cannot.
inline constexpr const char* kRunFile = "run.json";

/// Everything a run left in its folder, ready for a report: *.track.csv, and if present *.fit.json,
/// scene.toml, overlay.mp4, run.json, and *.timing.json named like the track.
/// @throws InputError if the folder holds no track or more than one.
[[nodiscard]] ReportInput read_run_folder(const std::filesystem::path& folder);

/// The scene stored in a fit, its camera file as it is named, seen from the fit's folder or from
/// here, else beside the fit.
[[nodiscard]] data::Scene scene_with_camera(const data::Fit& fit,
                                            const std::filesystem::path& fit_file);

}  // namespace trochoid::tools
