#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace trochoid::tools {

/// @throws InputError for "-", which elsewhere stands for standard output: no result goes there, as
/// each has others beside it.
void refuse_dash(const std::filesystem::path& output);

/// Called before the work, so that a wrong name costs no time and no recording: `output` must lie
/// in a folder that exists and be none of the files the command reads, nor another output among
/// them; a scene (.toml) is read with the camera file it names. Empty paths are skipped.
/// @throws InputError naming the output.
void check_output(const std::filesystem::path& output,
                  const std::vector<std::filesystem::path>& inputs);

/// The same for all that one command writes, none of which may be another.
void check_outputs(const std::vector<std::filesystem::path>& outputs,
                   const std::vector<std::filesystem::path>& inputs);

/// The same for a folder of results that is there or is to be made: no file may be in its place,
/// nor its name be a picture's or a table's. @throws InputError naming it.
void check_folder(const std::filesystem::path& folder);

/// Checks a folder and makes it, with those above it. @throws InputError naming it.
void make_folder(const std::filesystem::path& folder);

/// A run has at most `most` rows (whatever `rows` calls them): more are a slip of the pen.
/// @throws InputError naming the scene, and the keys and options that ask for more.
void check_length(const std::string& scene, double until_s, double rate_hz, double most,
                  const std::string& rows);

/// A word as a shell would take it: with anything but plain characters it goes into quotes.
[[nodiscard]] std::string shell_quoted(const std::string& word);

}  // namespace trochoid::tools
