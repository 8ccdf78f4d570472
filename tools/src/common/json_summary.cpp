#include "common/json_summary.hpp"

#include <fmt/core.h>

namespace trochoid::tools {

void add_json_flag(CLI::App& command, bool& json) {
  command.add_flag("--json", json, "End with a summary as JSON on standard output");
}

void print_json(const nlohmann::ordered_json& summary) {
  fmt::print("{}\n", summary.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
}

}  // namespace trochoid::tools
