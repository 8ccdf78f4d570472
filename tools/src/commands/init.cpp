#include <fmt/format.h>

#include <unistd.h>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <string>

#include "commands.hpp"
#include "common/json_object.hpp"
#include "common/json_summary.hpp"
#include "common/outputs.hpp"
#include "common/progress.hpp"
#include "common/recording_name.hpp"
#include "common/validators.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/tracking/inspect.hpp"

// init: a scene file from a first look at the recording, to be read and corrected.
namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;
using tracking::Inspection;

struct InitOptions {
  fs::path video, output;
  double radius_mm = 0.0;
  std::optional<double> rate_hz;
  bool force = false, json = false;
};

constexpr double kFlatRatio =
    0.9;  // an outline that never gets narrower belongs to a body that lies flat
constexpr double kPlaceholder_mm = 25.0;  // a large coin

CLI::Validator radius_in_mm() {
  return number_within(0.1, 10000.0);
}

/// Asks on a terminal only, until the answer is a radius or nothing; nothing is asked of a script.
double ask_radius_mm() {
  if (isatty(STDIN_FILENO) == 0 || isatty(STDERR_FILENO) == 0) return 0.0;
  while (true) {
    fmt::print(stderr, "radius of the body in mm (Enter if not known yet): ");
    std::string line;
    if (!std::getline(std::cin, line) || line.empty()) return 0.0;
    const std::string wrong = radius_in_mm()(line);
    if (wrong.empty()) return std::stod(line);
    fmt::print(stderr, "{}\n", wrong);
  }
}

std::string video_words(const tracking::VideoInfo& video) {
  std::string words =
      fmt::format("# {} x {} px, {:.4g} frames/s{}, {}\n", video.width_px, video.height_px,
                  video.frame_rate_hz, video.variable_rate ? " (variable)" : "", video.codec);
  return words;
}

/// Lengths of the body, measured or guessed.
struct Measures {
  double radius_m, inner_radius_m, thickness_m;
  bool measured, ring;  ///< the radius; whether there is a bore
};

Measures measures_of(const Inspection& seen, double radius_mm) {
  const bool measured = radius_mm > 0.0;
  const double radius_m = 1e-3 * (measured ? radius_mm : kPlaceholder_mm);
  return {radius_m, 0.8 * radius_m, 0.1 * radius_m, measured, seen.body && seen.body->bore_shows};
}

std::string body_words(const Inspection& seen, const Measures& body) {
  std::string text = "[body]\n";
  if (!seen.body)
    text += "kind = \"disc\"             # NOT SEEN, a placeholder; else \"ring\" or \"top\"\n";
  else if (body.ring)
    text += "kind = \"ring\"             # the floor shows through its middle; else \"disc\"\n";
  else
    text += "kind = \"disc\"             # nothing shows through its middle; else \"ring\"\n";
  text += fmt::format(
      "radius_m = {:<15g} # {}\n", body.radius_m,
      body.measured ? "outer rim"
                    : "NOT MEASURED, a placeholder: every length in the result scales with it");
  if (body.ring)
    text += fmt::format("inner_radius_m = {:<9g} # the bore: a guess, measure it\n",
                        body.inner_radius_m);
  text += fmt::format("thickness_m = {:<12g} # a guess, measure it\n", body.thickness_m);
  text += "# mass_kg = 0.03           # from the balance; needed for forces and losses\n";
  text += "# mark = { distance_m = 0.02, size_m = 0.003 }   # a dot on the face shows the spin\n";
  if (seen.body)
    text += fmt::format("# seen {:.0f} px in radius, tilted up to about {:.0f} degrees\n",
                        seen.body->radius_px,
                        data::degrees(std::acos(std::min(1.0, seen.body->least_axis_ratio))));
  return text;
}

/// A guess must not look like a fact in the result: its doubt goes into the error bars.
std::string prior_words(const Measures& body) {
  std::string list;
  if (!body.measured)
    list += fmt::format("radius_m = [{:g}, {:g}], ", body.radius_m, 0.5 * body.radius_m);
  if (body.ring)
    list +=
        fmt::format("inner_radius_m = [{:g}, {:g}], ", body.inner_radius_m, 0.1 * body.radius_m);
  list += fmt::format("thickness_m = [{:g}, {:g}]", body.thickness_m, 0.5 * body.thickness_m);
  return fmt::format(
      "\n[fit]                      # guess, standard deviation: these widen the error bars; take "
      "out what you have measured\nprior = {{ {} }}\n",
      list);
}

std::string support_words(const Inspection& seen) {
  constexpr double kStays = 0.1;  // of its radius: what turns on the spot is held there
  if (!seen.body)
    return "\n# [support]\n# kind = \"floor\"          # runs on its rim; \"flat\": slides on its "
           "face; \"pivot\": turns about a fixed point\n";
  const bool flat = seen.body->least_axis_ratio > kFlatRatio;
  const bool held = flat && seen.body->travel_px < kStays * seen.body->radius_px;
  const char* kind = held ? "pivot" : flat ? "flat" : "floor";
  const char* why = held   ? "its centre stays: it turns about a fixed point"
                    : flat ? "its outline never gets narrow: it slides on its face"
                           : "its outline gets narrow: it tilts and runs on its rim";
  return fmt::format(
      "\n[support]\nkind = {:<19} # {}\n# \"floor\": runs on its rim; \"flat\": slides on its "
      "face; \"pivot\": turns about a fixed point,\n# a disc on a pin, or a top (then pivot_m = "
      "[0.01, 0.02, 0.03] says where, in metres)\n",
      fmt::format("\"{}\"", kind), why);
}

std::string camera_words(const Inspection& seen, const std::optional<double>& rate_hz) {
  std::string text =
      "\n[camera]                   # without file or scale run takes it from the body's outline\n";
  text +=
      "# file = \"camera.json\"     # from trochoid calibrate; pictures of a board tell it best\n";
  text += "# scale_px_per_m = 1000    # or: pixels per metre on the floor\n";
  if (rate_hz)
    text += fmt::format("frame_rate_hz = {:<10g} # as given\n", *rate_hz);
  else if (seen.video.played_rate_hz)
    text += fmt::format(
        "frame_rate_hz = {:<10g} # the file says it was filmed at this rate and plays at {:.4g}\n",
        seen.video.frame_rate_hz, *seen.video.played_rate_hz);
  else
    text += "# frame_rate_hz = 240      # the true rate, if this was filmed in slow motion\n";
  if (seen.body && seen.body->least_axis_ratio > kFlatRatio && seen.body->usual_axis_ratio < 0.985)
    text += fmt::format(
        "# the outline is always {:.3f} as wide as long: the camera may look down at {:.0f} "
        "degrees\n"
        "# from the vertical; calibrate it\n",
        seen.body->usual_axis_ratio, data::degrees(std::acos(seen.body->usual_axis_ratio)));
  return text;
}

/// A name for a line of comment, which holds neither ends of lines nor broken UTF-8.
std::string in_comment(const std::string& name) {
  std::string words = as_utf8(name);
  for (char& c : words)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  return words;
}

std::string scene_text(const InitOptions& options, const Inspection& seen, double radius_mm) {
  std::string text = fmt::format(
      "# {}: what a first look tells. Read it, correct it, then\n#   trochoid run {} --scene {}\n",
      in_comment(options.video.filename().string()),
      in_comment(shell_quoted(options.video.string())),
      in_comment(shell_quoted(options.output.string())));
  text += video_words(seen.video);
  if (!seen.body) text += "# NO MOVING BODY FOUND: point at it with [tracking] at_px\n";
  if (seen.restless > 0.3)
    text += fmt::format("# {:.0f} % of the picture changes all the time: does the camera move?\n",
                        100.0 * seen.restless);
  const Measures body = measures_of(seen, radius_mm);
  text += "# Every key: docs/formats.md\n\n" + body_words(seen, body) + support_words(seen) +
          camera_words(seen, options.rate_hz) + prior_words(body);
  text +=
      "\n# [tracking]\n# objects = 2              # more than one body\n# from = 0.5               "
      "# seconds, or \"f120\"\n";
  return text;
}

void tell_json(const InitOptions& options, const Inspection& seen) {
  nlohmann::ordered_json summary{{"scene", options.output.string()},
                                 {"frame_rate_hz", seen.video.frame_rate_hz},
                                 {"found", seen.body.has_value()}};
  if (seen.body)
    summary.update({{"kind", seen.body->bore_shows ? "ring" : "disc"},
                    {"radius_px", seen.body->radius_px},
                    {"frames", seen.body->frames}});
  print_json(summary);
}

void run(InitOptions options) {
  if (options.output.empty()) options.output = recording_name(options.video) + ".toml";
  check_output(options.output, {options.video});
  if (fs::exists(options.output) && !options.force)
    throw InputError(
        fmt::format("{}: exists already; name another with -o or replace it with --force",
                    options.output.string()));
  const Inspection seen = tracking::inspect_video(options.video, options.rate_hz);
  const double radius_mm = options.radius_mm > 0.0 ? options.radius_mm : ask_radius_mm();
  const std::string text = scene_text(options, seen, radius_mm);
  (void)data::parse_scene(text, options.output.string());  // what is written can be read
  data::write_text(text, options.output);
  if (options.json) tell_json(options, seen);
  if (!seen.body)
    throw NotGood(
        fmt::format("{}: no moving body found; {} holds placeholders only, to be filled in by hand",
                    options.video.string(), options.output.string()));
  if (options.json) return;
  note(fmt::format("{}: {} of about {:.0f} px radius, followed through {} frames",
                   options.output.string(), seen.body->bore_shows ? "a ring" : "a disc",
                   seen.body->radius_px, seen.body->frames));
}

}  // namespace

void add_init_command(CLI::App& app) {
  auto options = std::make_shared<InitOptions>();
  CLI::App* command =
      app.add_subcommand("init", "Write a scene file from a first look at a recording");
  command->add_option("video", options->video, "Recording")->required()->transform(without_slash());
  command->add_option("-o,--output", options->output, "Scene to write [VIDEO's name with .toml]");
  command->add_option("--radius-mm", options->radius_mm, "Radius of the body [mm], if known")
      ->check(radius_in_mm());
  command
      ->add_option("--rate", options->rate_hz,
                   "True frame rate [Hz]: of slow motion, or of an image folder or series")
      ->check(frame_rate());
  command->add_flag("--force", options->force, "Replace the scene if it exists");
  add_json_flag(*command, options->json);
  command->footer("Example: trochoid init ring.mp4 --radius-mm 30 -o ring.toml");
  command->callback([options] { run(*options); });
}

}  // namespace trochoid::tools
