#include "common/track_options.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cstdio>
#include <map>

#include "common/not_good.hpp"
#include "common/validators.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/moment.hpp"

namespace trochoid::tools {
namespace {

const std::map<std::string, tracking::Effort> kEfforts{{"quick", tracking::Effort::quick},
                                                       {"normal", tracking::Effort::normal},
                                                       {"exact", tracking::Effort::exact}};

constexpr int kMostObjects = data::TrackingSettings::kMostObjects;

std::optional<Eigen::Vector2d> point_named(const std::string& text) {
  double x = 0.0, y = 0.0;
  char rest = 0;
  if (std::sscanf(text.c_str(), "%lf,%lf%c", &x, &y, &rest) != 2) return std::nullopt;
  return Eigen::Vector2d(x, y);
}

CLI::Validator point() {
  return {[](const std::string& text) {
            return point_named(text) ? std::string()
                                     : "'" + text + "' is not a point x,y in pixels";
          },
          "X,Y"};
}

}  // namespace

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

data::Scene chosen_scene(data::Scene scene, const TrackChoices& choices) {
  const auto check = [](const char* name, const auto& value, auto least, auto most) {
    if (value && !(*value >= least && *value <= most))
      throw InputError(
          fmt::format("{} = {} must be a number from {:g} to {:g}", name, *value, least, most));
  };
  check("objects", choices.objects, 1.0, static_cast<double>(kMostObjects));
  check("rate_hz", choices.rate_hz, kSlowest_Hz, kFastest_Hz);
  (void)data::parse_recording_window(choices.from, choices.to);
  if (choices.objects) scene.tracking.objects = *choices.objects;
  if (choices.at_px) scene.tracking.at_px = choices.at_px;
  if (choices.rate_hz) scene.camera.frame_rate_hz = choices.rate_hz;
  return scene;
}

tracking::TrackOptions track_options(const data::Scene& scene, const TrackChoices& choices) {
  tracking::TrackOptions how;
  how.objects = scene.tracking.objects;
  how.from = choices.from;
  how.to = choices.to;
  how.effort = choices.effort;
  return how;
}

void add_track_options(CLI::App& command, TrackInputs& inputs, TrackChoices& choices,
                       const std::string& effort_words) {
  command.add_option("video", inputs.video, "Video file, image folder or series (img/%04d.png)")
      ->transform(without_slash())
      ->required();
  command.add_option("--scene,-s", inputs.scene,
                     "Scene file: body, camera, model (docs/formats.md); without body and camera a "
                     "track in pixels");
  command.add_option("--camera", inputs.camera, "Camera file; replaces the scene's");
  command
      .add_option("--objects", choices.objects,
                  "Number of moving bodies, all of the size the scene gives")
      ->check(whole_number_within(1, kMostObjects));
  command
      .add_option_function<std::string>(
          "--at", [&choices](const std::string& text) { choices.at_px = point_named(text); },
          "A point x,y [px] on the body in the first frame used")
      ->check(point());
  command.add_option("--from", choices.from, "First moment: seconds (1.5) or a frame (f120)");
  command.add_option("--to", choices.to, "Last moment: seconds or a frame");
  command
      .add_option("--rate", choices.rate_hz,
                  "True frame rate [Hz]: of slow motion, or of an image folder or series")
      ->check(frame_rate());
  command
      .add_option_function<std::string>(
          "--effort", [&choices](const std::string& name) { choices.effort = kEfforts.at(name); },
          effort_words)
      ->check(CLI::IsMember(kEfforts));
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
