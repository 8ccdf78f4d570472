#pragma once
#include <CLI/CLI.hpp>
#include <Eigen/Core>
#include <string>

#include "trochoid/data/track.hpp"
#include "trochoid/tracking/effort.hpp"

namespace trochoid::tools {

/// --effort quick|normal|exact.
void add_effort(CLI::App& command, tracking::Effort& effort, const std::string& words);
[[nodiscard]] std::string effort_name(tracking::Effort effort);
[[nodiscard]] bool is_effort(const std::string& name);
/// @throws InputError unless the name is quick, normal or exact.
[[nodiscard]] tracking::Effort effort_named(const std::string& name);

/// --at x,y: a point on the body, for recordings in which it is not found by itself.
void add_at(CLI::App& command, std::string& at);
/// @throws InputError unless the text is x,y [px].
[[nodiscard]] Eigen::Vector2d parse_point(const std::string& text);

/// What is found in a track to be sure of, once its files are written.
/// @throws NotGood if fewer bodies were found than wanted, or one only in frames that are doubtful.
void check_found(const data::TrackFile& found, int wanted);

}  // namespace trochoid::tools
