#include "track_options.hpp"

#include <fmt/core.h>

#include <cstdio>
#include <map>

#include "trochoid/data/error.hpp"

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

bool is_effort(const std::string& name) {
  return kEfforts.contains(name);
}

tracking::Effort effort_named(const std::string& name) {
  if (!is_effort(name))
    throw InputError(fmt::format("effort = '{}': it is quick, normal or exact", name));
  return kEfforts.at(name);
}

std::string effort_name(tracking::Effort effort) {
  for (const auto& [name, value] : kEfforts)
    if (value == effort) return name;
  return {};
}

void add_at(CLI::App& command, std::string& at) {
  command.add_option("--at", at, "A point x,y [px] on the body in the first frame used");
}

Eigen::Vector2d parse_point(const std::string& text) {
  double x = 0.0, y = 0.0;
  char rest = 0;
  if (std::sscanf(text.c_str(), "%lf,%lf%c", &x, &y, &rest) != 2)
    throw InputError(fmt::format("--at {}: give a point in pixels as x,y", text));
  return {x, y};
}

}  // namespace trochoid::tools
