#pragma once
#include <CLI/CLI.hpp>
#include <string>

#include "trochoid/tracking/effort.hpp"

namespace trochoid::tools {

/// --effort quick|normal|exact.
void add_effort(CLI::App& command, tracking::Effort& effort, const std::string& words);
[[nodiscard]] std::string effort_name(tracking::Effort effort);

}  // namespace trochoid::tools
