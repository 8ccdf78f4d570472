#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "report/report.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::tools {

/// A folder beside `target` that becomes `target` on commit() and vanishes otherwise, so that a run
/// leaves all its files or none. An existing folder is replaced only if a run made it.
class PendingFolder {
 public:
  /// @throws InputError if the target cannot be written, is something a run did not make, or holds
  /// something else or one of the files that are read.
  explicit PendingFolder(std::filesystem::path target,
                         const std::vector<std::filesystem::path>& inputs = {});
  ~PendingFolder();
  PendingFolder(const PendingFolder&) = delete;
  PendingFolder& operator=(const PendingFolder&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return temporary_; }
  void commit();
  /// Runs `write`; what it complains about names the folder as the user knows it.
  template <class Write>
  auto told_by_its_name(const Write& write) const {
    try {
      return write();
    } catch (const InputError& error) {
      throw InputError(with_own_name(error.what()));
    }
  }

 private:
  [[nodiscard]] std::string with_own_name(std::string message) const;
  std::filesystem::path target_, temporary_;
};

/// File of a run's folder that marks it as ours and tells what the other files cannot.
inline constexpr const char* kRunFile = "run.json";

/// Everything a run left in its folder, ready for a report: *.track.csv, and if present *.fit.json,
/// scene.toml, overlay.mp4, run.json, and *.timing.json named like the track.
/// @throws InputError if the folder holds no track or more than one.
[[nodiscard]] ReportInput read_run_folder(const std::filesystem::path& folder);

/// The scene stored in a fit, its camera file as it is named, seen from the fit's folder or from
/// here, else beside the fit.
[[nodiscard]] data::Scene scene_of_fit(const data::Fit& fit, const std::filesystem::path& fit_file);

}  // namespace trochoid::tools
