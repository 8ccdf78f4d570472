#include <fmt/format.h>
#include <fmt/ranges.h>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "common/json_summary.hpp"
#include "common/outputs.hpp"
#include "common/progress.hpp"
#include "common/scene_library.hpp"
#include "common/track_options.hpp"
#include "common/validators.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/tracking/smooth.hpp"
#include "trochoid/tracking/tracker.hpp"

namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

struct Options {
  fs::path video, scene, camera, edges, smooth, output;
  int objects = 0;
  std::string from, to, at;
  double rate_hz = 0.0;
  tracking::Effort effort = tracking::Effort::normal;
  bool json = false;
};

data::Scene scene_of(const Options& options) {
  data::Scene scene;
  if (!options.scene.empty()) scene = data::read_scene(options.scene);
  if (options.rate_hz > 0.0) scene.camera.frame_rate_hz = options.rate_hz;
  if (!options.at.empty()) scene.tracking.at_px = parse_point(options.at);
  if (options.objects > 0) scene.tracking.objects = options.objects;
  return scene;
}

/// Run times live beside the track, so that the track itself is the same from run to run.
fs::path timing_file(fs::path track) {
  return track.replace_extension(".timing.json");
}

void write_timing(const fs::path& track, double seconds, const tracking::TrackSummary& summary) {
  const nlohmann::json timing = {{"command", "track"},
                                 {"seconds", seconds},
                                 {"frames", summary.frames},
                                 {"frames_per_s", static_cast<double>(summary.frames) / seconds}};
  data::write_text(timing.dump(2) + "\n", timing_file(track));
}

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
void tell(const Options& options, const tracking::TrackResult& result,
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

void run(const Options& options) {
  const auto start = std::chrono::steady_clock::now();
  check_outputs({options.output, options.edges, options.smooth, timing_file(options.output)},
                {options.video, options.scene, options.camera});
  const data::Scene scene = scene_of(options);
  const std::optional<data::Camera> camera = named_camera(options.camera, scene, options.scene);
  tracking::TrackOptions how;
  how.objects = scene.tracking.objects;
  how.from = options.from;
  how.to = options.to;
  how.effort = options.effort;
  if (!options.edges.empty()) how.edges = options.edges;
  tracking::TrackResult result;
  {
    Progress progress("track");
    how.progress = [&](std::int64_t done, std::int64_t total) { progress.update(done, total); };
    result = tracking::track_video(options.video, scene, camera, how);
  }
  result.file.made_by = "trochoid " TROCHOID_VERSION;
  data::write_track(result.file, options.output);
  std::optional<tracking::SmoothTrack> smoothed;
  if (!options.smooth.empty()) {
    smoothed = tracking::smooth_track(result.file);
    data::write_table(smoothed->table, options.smooth);
  }
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  write_timing(options.output, elapsed.count(), result.summary);
  detail_tracks(result.file);
  tell(options, result, smoothed);
  check_found(result.file, scene.tracking.objects);
}

}  // namespace

void add_track_command(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* track = app.add_subcommand("track", "Follow the moving bodies of a recording");
  track->add_option("video", options->video, "Video file, image folder or series (img/%04d.png)")
      ->transform(without_slash())
      ->required();
  track->add_option("--scene,-s", options->scene,
                    "Scene file (docs/formats.md); without body and camera a track in pixels");
  track->add_option("--camera", options->camera, "Camera file; replaces the scene's");
  track
      ->add_option("--objects", options->objects,
                   "Number of moving bodies, all of the size the scene gives")
      ->check(whole_number_within(1, 64));
  track->add_option("--from", options->from, "First frame to use: seconds (1.5) or frame (f120)");
  track->add_option("--to", options->to, "Last frame to use: seconds or frame");
  add_at(*track, options->at);
  track->add_option("--edges", options->edges, "Also write the accepted edge points (CSV)");
  track->add_option("--smooth", options->smooth,
                    "Also write smoothed positions and velocities (CSV); never fit these");
  track
      ->add_option("--rate", options->rate_hz,
                   "True frame rate [Hz]: of slow motion, or of an image folder or series")
      ->check(frame_rate());
  add_effort(
      *track, options->effort,
      "How closely outlines are looked at: quick, normal or exact (study chain shows the cost)");
  track->add_option("-o,--output", options->output, "Track CSV to write")->required();
  add_json_flag(*track, options->json);
  track->footer("Example: trochoid track ring.mp4 --scene ring.toml -o ring.track.csv");
  track->callback([options] { run(*options); });
}

}  // namespace trochoid::tools
