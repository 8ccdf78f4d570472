#include "common/provenance.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::tools {

namespace fs = std::filesystem;

namespace {

/// Two recordings may have one name, in folders of their own.
void add_named(Checksums& checksums, const std::string& name, const std::string& longer_name,
               const std::string& digest) {
  const auto known = checksums.find(name);
  checksums[known == checksums.end() || known->second == digest ? name : longer_name] = digest;
}

}  // namespace

void add_checksum(Checksums& checksums, const fs::path& file) {
  add_named(checksums, file.filename().string(), file.string(), data::sha256_of_file(file));
}

void add_scene(Checksums& checksums, const fs::path& named, const data::Scene& scene) {
  std::error_code ignored;
  for (const fs::path& file : {named, fs::path(scene.camera.file)})
    if (fs::is_regular_file(file, ignored)) add_checksum(checksums, file);
}

void add_track(Checksums& checksums, const fs::path& file) {
  const std::string digest = data::sha256_of_file(file);
  for (const auto& [name, known] : checksums)
    if (known == digest)
      throw InputError(
          fmt::format("{}: is the same track as {}; a recording counts once", file.string(), name));
  add_named(checksums, file.filename().string(), file.string(), digest);
}

void add_recording(Checksums& checksums, const std::string& source, const std::string& sha256,
                   const std::string& track) {
  if (!sha256.empty()) add_named(checksums, source, "source of " + track, sha256);
}

void check_made_from(const data::Fit& fit, const fs::path& fit_path, const fs::path& track_path) {
  const bool tells = std::any_of(fit.inputs.begin(), fit.inputs.end(),
                                 [](const auto& input) { return input.first.ends_with(".csv"); });
  if (!tells) return;
  const std::string digest = data::sha256_of_file(track_path);
  if (std::none_of(fit.inputs.begin(), fit.inputs.end(),
                   [&](const auto& input) { return input.second == digest; }))
    throw InputError(fmt::format("{}: was not fitted to {} as it is now; fit this track",
                                 fit_path.string(), track_path.string()));
}

int tracks_fitted(const data::Fit& fit, const data::TrackFile& file) {
  const auto is_fitted = [&](const data::Track& track) {
    return std::any_of(fit.arcs.begin(), fit.arcs.end(),
                       [&](const data::FitArc& arc) { return arc.object == track.object; });
  };
  const auto fitted = std::count_if(file.tracks.begin(), file.tracks.end(), is_fitted);
  // The only body of another tool's file may have any number.
  return fitted == 0 ? static_cast<int>(file.tracks.size()) : static_cast<int>(fitted);
}

int place_in_fit(const data::Fit& fit, const std::string& fit_name, const data::TrackFile& file,
                 std::optional<int> asked) {
  int fitted = 0;
  for (const data::FitArc& arc : fit.arcs) fitted = std::max(fitted, arc.track + 1);
  const int others = std::max(0, fitted - tracks_fitted(fit, file));
  const std::string count = fmt::format("{} track{}", fitted, fitted == 1 ? "" : "s");
  if (fitted > 0 && asked && (*asked < 0 || *asked > others))
    throw InputError(fmt::format(
        "{}: is of {}, counted from 0: --fit-track (fit_track) = {} is none that this may be",
        fit_name, count, *asked));
  if (!asked && others > 0)
    throw InputError(
        fmt::format("{}: is of {}; --fit-track (fit_track) must say which of them this is, "
                    "from 0 to {}",
                    fit_name, count, others));
  return asked.value_or(0);
}

}  // namespace trochoid::tools
