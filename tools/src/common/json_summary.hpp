#pragma once
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

namespace trochoid::tools {

/// --json: instead of words for people a command ends with one JSON object on stdout
/// (docs/formats.md lists the keys).
void add_json_flag(CLI::App& command, bool& json);

/// As json_text() has it.
void print_json(const nlohmann::ordered_json& summary);

}  // namespace trochoid::tools
