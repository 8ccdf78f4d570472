#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "commands/body_camera.hpp"
#include "common/json_summary.hpp"
#include "common/outputs.hpp"
#include "common/progress.hpp"
#include "common/scene_library.hpp"
#include "common/timing.hpp"
#include "common/track_options.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/tracking/smooth.hpp"
#include "trochoid/tracking/tracker.hpp"

namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

struct TrackCommandOptions {
  TrackInputs inputs;
  TrackChoices choices;
  fs::path edges, smooth, output;
  bool json = false;
};

/// Frame by frame what deserves a look: gaps, and samples to be doubted.
void detail_tracks(const data::TrackFile& file) {
  for (const data::Track& track : file.tracks) {
    if (track.samples.empty()) continue;
    std::vector<std::int64_t> doubtful;
    for (const data::TrackSample& sample : track.samples)
      if (sample.doubtful()) doubtful.push_back(sample.frame);
    detail(fmt::format("object {}: {} samples, frames {} to {}; doubtful frames: {}", track.object,
                       track.samples.size(), track.samples.front().frame,
                       track.samples.back().frame,
                       doubtful.empty() ? "none" : fmt::format("{}", fmt::join(doubtful, ", "))));
  }
}

std::string smooth_words(const tracking::SmoothTrack& smoothed) {
  std::string words = fmt::format(" {} interpolated,", smoothed.interpolated);
  if (smoothed.left_out > 0)
    words += fmt::format(" {} too few together to be smoothed,", smoothed.left_out);
  return words;
}

/// How many frames showed what, for people or for scripts.
void tell(const TrackCommandOptions& options, const tracking::TrackResult& result,
          const std::optional<tracking::SmoothTrack>& smoothed) {
  const tracking::TrackSummary& s = result.summary;
  if (!options.json) {
    const std::size_t count = result.file.tracks.size();
    const std::string bodies = count == 1 ? "1 body" : fmt::format("{} bodies", count);
    note(
        fmt::format("{}: {} in {} frames: {} found, {} lost, {} doubtful,{} {} frames "
                    "damaged; metres: {}",
                    options.output.string(), bodies, s.frames, s.found, s.lost, s.doubtful,
                    smoothed ? smooth_words(*smoothed) : "", s.damaged, s.camera_words));
    for (const std::string& line : result.file.notes) note(line);
    return;
  }
  nlohmann::ordered_json summary{{"track", options.output.string()},
                                 {"bodies", result.file.tracks.size()},
                                 {"frames", s.frames},
                                 {"found", s.found},
                                 {"lost", s.lost},
                                 {"doubtful", s.doubtful},
                                 {"damaged", s.damaged},
                                 {"metres", s.camera_words},
                                 {"notes", result.file.notes}};
  if (smoothed) {
    summary["smooth"] = options.smooth.string();
    summary["interpolated"] = smoothed->interpolated;
    summary["left_out"] = smoothed->left_out;
  }
  print_json(summary);
}

void run(const TrackCommandOptions& options) {
  const Stopwatch watch;
  check_outputs({options.output, options.edges, options.smooth, timing_file(options.output)},
                {options.inputs.video, options.inputs.scene, options.inputs.camera});
  const TrackInputs& inputs = options.inputs;
  const data::Scene scene = chosen_scene(
      inputs.scene.empty() ? data::Scene{} : data::read_scene(inputs.scene), options.choices);
  const std::optional<data::Camera> camera = named_camera(inputs.camera, scene, inputs.scene);
  tracking::TrackOptions how = track_options(scene, options.choices);
  how.edges = !options.edges.empty();
  tracking::TrackResult result;
  {
    Progress progress("track");
    how.progress = [&](std::int64_t done, std::int64_t total) { progress.update(done, total); };
    result = tracking::track_video(inputs.video, scene, camera, how);
  }
  result.file.made_by = "trochoid " TROCHOID_VERSION;
  if (std::string way = camera ? "" : way_to_a_camera(scene); !way.empty())
    result.file.notes.push_back(std::move(way));
  data::write_track(result.file, options.output);
  if (result.edges) data::write_table(*result.edges, options.edges);
  std::optional<tracking::SmoothTrack> smoothed;
  if (!options.smooth.empty()) {
    smoothed = tracking::smooth_track(result.file);
    data::write_table(smoothed->table, options.smooth);
  }
  const double seconds = watch.seconds();
  write_timing(options.output,
               {{"command", "track"},
                {"seconds", seconds},
                {"frames", result.summary.frames},
                {"frames_per_s", static_cast<double>(result.summary.frames) / seconds}});
  detail_tracks(result.file);
  tell(options, result, smoothed);
  check_found(result.file, scene.tracking.objects);
}

}  // namespace

void add_track_command(CLI::App& app) {
  auto options = std::make_shared<TrackCommandOptions>();
  CLI::App* track = app.add_subcommand("track", "Follow the moving bodies of a recording");
  add_track_options(
      *track, options->inputs, options->choices,
      "How closely outlines are looked at: quick, normal or exact (study chain shows the cost)");
  track->add_option("--edges", options->edges, "Also write the accepted edge points (CSV)");
  track->add_option("--smooth", options->smooth,
                    "Also write smoothed positions and velocities (CSV); never fit these");
  track->add_option("-o,--output", options->output, "Track CSV to write")->required();
  add_json_flag(*track, options->json);
  track->footer("Example: trochoid track ring.mp4 --scene ring.toml -o ring.track.csv");
  track->callback([options] { run(*options); });
}

}  // namespace trochoid::tools
