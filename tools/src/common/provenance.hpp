#pragma once
#include <filesystem>
#include <map>
#include <string>

#include "trochoid/data/fit.hpp"

namespace trochoid::tools {

/// Adds a file and its SHA-256 under its name; a second file of that name, under its folder too.
void add_checksum(std::map<std::string, std::string>& checksums, const std::filesystem::path& file);

/// Refuses to show a fit over a track it was not made from.
/// @throws InputError if the fit tells the checksums of what it read and the track is none of them.
void check_made_from(const data::Fit& fit, const std::filesystem::path& fit_path,
                     const std::filesystem::path& track_path);

}  // namespace trochoid::tools
