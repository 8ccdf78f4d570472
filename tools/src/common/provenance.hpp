#pragma once
#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "trochoid/data/fit.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/data/track.hpp"

namespace trochoid::tools {

/// SHA-256 of files by name, as Fit::inputs keeps them.
using Checksums = std::map<std::string, std::string>;

/// Adds a file under its name; a second file of that name, under its folder too.
void add_checksum(Checksums& checksums, const std::filesystem::path& file);

/// Adds the files a scene is made of: its own, if `named` is one (a bundled scene is none), and its
/// camera's.
void add_scene(Checksums& checksums, const std::filesystem::path& named, const data::Scene& scene);

/// The same for a track file. @throws InputError if it is among them: a recording counts once.
void add_track(Checksums& checksums, const std::filesystem::path& file);

/// Adds the recording that a track tells of, if it tells its checksum; where the name is another's,
/// as "source of `track`".
void add_recording(Checksums& checksums, const std::string& source, const std::string& sha256,
                   const std::string& track);

/// Refuses to show a fit over a track it was not made from.
/// @throws InputError if the fit tells the checksums of what it read and the track is none of them.
void check_made_from(const data::Fit& fit, const std::filesystem::path& fit_path,
                     const std::filesystem::path& track_path);

/// How many tracks of a file a fit of it counts: all, or the one body that --object picked.
[[nodiscard]] int tracks_fitted(const data::Fit& fit, const data::TrackFile& file);

/// Which of the tracks fitted together a track file is, from 0; the only one if there is no other.
/// @param asked  what the user says.
/// @throws InputError if the fit is of several files and nobody says, or it holds none of that
/// place.
[[nodiscard]] int place_in_fit(const data::Fit& fit, const std::string& fit_name,
                               const data::TrackFile& file, std::optional<int> asked);

}  // namespace trochoid::tools
