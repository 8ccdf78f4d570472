#include "common/json_summary.hpp"

#include <fmt/core.h>

#include "common/json_object.hpp"

namespace trochoid::tools {

void add_json_flag(CLI::App& command, bool& json) {
  command.add_flag("--json", json, "End with a summary as JSON on standard output");
}

void print_json(const nlohmann::ordered_json& summary) {
  fmt::print("{}\n", json_text(summary, 2));
}

}  // namespace trochoid::tools
