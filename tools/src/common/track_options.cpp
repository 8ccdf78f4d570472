#include "common/track_options.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cstdio>
#include <map>

#include "common/not_good.hpp"
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

void check_found(const data::TrackFile& found, int wanted) {
  if (found.tracks.size() < static_cast<std::size_t>(wanted))
    throw NotGood(fmt::format("only {} of {} moving bodies found", found.tracks.size(), wanted));
  for (const data::Track& track : found.tracks) {
    const auto& samples = track.samples;
    if (std::all_of(samples.begin(), samples.end(), [](const auto& s) { return s.doubtful(); }))
      throw NotGood(fmt::format(
          "{}{} doubtful: more of the recording may tell its tilt from the mirrored one; else "
          "check "
          "the scene's dimensions and camera, or point at the body with --at x,y",
          found.tracks.size() > 1 ? fmt::format("object {}: ", track.object) : "",
          samples.size() == 1 ? std::string("the only frame with the body is")
                              : fmt::format("all {} frames with the body are", samples.size())));
  }
}

}  // namespace trochoid::tools
