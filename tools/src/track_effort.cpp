#include "track_effort.hpp"

#include <map>

namespace trochoid::tools {
namespace {

const std::map<std::string, tracking::Effort> kEfforts{{"quick", tracking::Effort::quick},
                                                       {"normal", tracking::Effort::normal},
                                                       {"exact", tracking::Effort::exact}};

}  // namespace

void add_effort(CLI::App& command, tracking::Effort& effort, const std::string& words) {
  command
      .add_option_function<std::string>(
          "--effort", [&effort](const std::string& name) { effort = kEfforts.at(name); }, words)
      ->check(CLI::IsMember(kEfforts));
}

std::string effort_name(tracking::Effort effort) {
  for (const auto& [name, value] : kEfforts)
    if (value == effort) return name;
  return {};
}

}  // namespace trochoid::tools
