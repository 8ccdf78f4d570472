#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "commands.hpp"
#include "common/json_summary.hpp"
#include "common/outputs.hpp"
#include "common/progress.hpp"
#include "common/provenance.hpp"
#include "common/scene_library.hpp"
#include "common/validators.hpp"
#include "draw/encoded_file.hpp"
#include "draw/overlay.hpp"
#include "report/run_folder.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::tools {
namespace {

struct OverlayCommandOptions {
  std::string video, track, fit, scene, camera, output, still, from, to;
  double slow = 0.0;
  std::optional<int> fit_track;
  bool json = false;
};

/// The camera of a scene that was kept in a fit may have gone since.
void tell_missing_camera(const data::Scene& scene, const std::string& fit) {
  std::error_code ignored;
  if (scene.camera.file.empty() || std::filesystem::exists(scene.camera.file, ignored)) return;
  note(
      fmt::format("{}: its camera, {}, is not there: metres are placed in the picture by the "
                  "track, as if seen from straight above; --camera names it",
                  fit, scene.camera.file));
}

OverlayInput read_inputs(const OverlayCommandOptions& options) {
  OverlayInput input;
  input.video = options.video;
  input.tracks = data::read_track(options.track);
  check_recording(input, options.track);
  if (!options.fit.empty()) {
    input.fit = data::read_fit(options.fit);
    check_made_from(*input.fit, options.fit, options.track);
  }
  if (!options.scene.empty()) {
    input.scene = data::read_scene(options.scene);
  } else if (input.fit) {
    input.scene = scene_with_camera(*input.fit, options.fit);
    if (options.camera.empty()) tell_missing_camera(*input.scene, options.fit);
  }
  input.camera = named_camera(options.camera, options.scene.empty() ? data::Scene{} : *input.scene,
                              options.scene);
  if (input.fit)
    input.fit_track = place_in_fit(*input.fit, options.fit, input.tracks, options.fit_track);
  return input;
}

void run(const OverlayCommandOptions& options) {
  check_outputs({options.output, options.still},
                {options.video, options.track, options.fit, options.scene, options.camera});
  if (!options.still.empty()) check_picture_name(options.still);
  if (!options.output.empty()) check_overlay_name(options.output);
  if (options.output.empty() && options.still.empty())
    throw InputError("overlay: nothing to write; give -o overlay.mp4, --still path.png or both");
  const OverlayInput input = read_inputs(options);
  const OverlayOptions how{.from = options.from, .to = options.to, .slow = options.slow};
  nlohmann::ordered_json summary;
  if (!options.still.empty()) {
    write_still(input, how, options.still);
    summary["still"] = options.still;
  }
  if (!options.output.empty()) {
    const OverlayFrames frames = write_overlay(input, how, options.output);
    summary["overlay"] = options.output;
    summary["frames"] = frames.frame.size();
    summary["frame_rate_hz"] = frames.frame_rate_hz;
    summary["slowed"] = frames.slowed;
    summary["width_px"] = frames.width_px;
    summary["height_px"] = frames.height_px;
  }
  if (options.json) {
    print_json(summary);
    return;
  }
  for (const std::string& written : {options.output, options.still})
    if (!written.empty()) note("wrote " + written);
}

}  // namespace

void add_overlay_command(CLI::App& app) {
  const auto options = std::make_shared<OverlayCommandOptions>();
  CLI::App* command =
      app.add_subcommand("overlay", "Draw observed and predicted path into the recording");
  command->add_option("video", options->video, "Recording the track was made from")
      ->required()
      ->transform(without_slash());
  command->add_option("--track", options->track, "Track CSV")->required();
  command->add_option("--fit", options->fit, "Fit JSON; without it only the observation is drawn");
  command->add_option("--scene,-s", options->scene,
                      "Scene TOML (default: the one stored in the fit)");
  command->add_option("--camera", options->camera, "Camera JSON, instead of the scene's");
  command->add_option("-o,--output", options->output, "Overlay video, .mp4 (H.264)");
  command->add_option("--still", options->still, "One picture of the whole path, .png or .jpg");
  command->add_option("--from", options->from, "First moment: seconds (1.5) or a frame (f120)");
  command->add_option("--to", options->to, "Last moment: seconds or a frame");
  command
      ->add_option("--slow", options->slow,
                   "Play this many times slower (default: at most 60 frames/s)")
      ->check(number_within(0.01, 1000.0))
      ->needs("--output");
  command
      ->add_option("--fit-track", options->fit_track,
                   "Place of this track among those fitted together (0 = first)")
      ->check(whole_number())
      ->needs("--fit");
  add_json_flag(*command, options->json);
  command->footer(
      "Example:\n  trochoid overlay ring.mp4 --track ring.track.csv --fit ring.fit.json "
      "-o ring.overlay.mp4 --still ring.path.png");
  command->callback([options] { run(*options); });
}

}  // namespace trochoid::tools
