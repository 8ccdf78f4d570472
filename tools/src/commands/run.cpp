#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "commands.hpp"
#include "commands/body_camera.hpp"
#include "common/fit_job.hpp"
#include "common/json_object.hpp"
#include "common/json_summary.hpp"
#include "common/outputs.hpp"
#include "common/pending_folder.hpp"
#include "common/progress.hpp"
#include "common/provenance.hpp"
#include "common/recording_name.hpp"
#include "common/scene_library.hpp"
#include "common/timing.hpp"
#include "common/track_options.hpp"
#include "common/validators.hpp"
#include "draw/overlay.hpp"
#include "report/parts.hpp"
#include "report/report.hpp"
#include "report/run_folder.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/fitting/compare.hpp"
#include "trochoid/fitting/fit.hpp"
#include "trochoid/fitting/motion_camera.hpp"
#include "trochoid/tracking/tracker.hpp"

// trochoid run: recording in, folder with track, fit, overlay and report out. Each stage calls what
// its own command calls; nothing is computed here.
namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

struct RunOptions {
  TrackInputs inputs;
  TrackChoices choices;
  std::string output, model;
  double slow = 0.0;
  std::uint64_t seed = 1;
  bool free_pivot = false, json = false;
};

/// What the stages hand to each other.
struct Run {
  data::Scene scene;
  std::optional<data::Camera> camera;
  bool told_by_body = false;  ///< by its outline
  std::string camera_note;    ///< what the body told of it, or why it did not
  tracking::TrackResult tracked;
  std::optional<data::Fit> fit;
  std::string no_fit_reason;
  OverlayFrames overlay;
  nlohmann::ordered_json times;

  template <class Stage>
  void timed(const char* name, const Stage& stage) {
    const Stopwatch watch;
    stage();
    times[std::string(name) + "_s"] = watch.seconds();
  }
};

fs::path folder_of(const RunOptions& options) {
  if (!options.output.empty()) return options.output;
  return recording_name(options.inputs.video) + ".trochoid";
}

std::string stem_of(const RunOptions& options) {
  return recording_name(options.inputs.video);
}

// A model that is named must be able to take its scene, and what [fit] says must mean something to
// one of those that are compared: said before the recording is tracked. Without a scale none is
// fitted.
void check_model(const data::Scene& scene, const std::optional<data::Camera>& camera,
                 const std::string& scene_name) {
  const bool scaled = camera || scene.camera.scale_px_per_m || scene.body;
  if (!scaled) return;
  in_scene(scene_name, [&] {
    if (scene.model.name == "auto")
      fitting::check_compared(with_rows(scene));
    else
      fitting::check_scene(with_rows(scene));
  });
}

Run prepared(const RunOptions& options) {
  Run run;
  const TrackInputs& inputs = options.inputs;
  if (!inputs.scene.empty()) run.scene = data::read_scene(inputs.scene);
  run.scene = chosen_scene(std::move(run.scene), options.choices);
  if (!options.model.empty()) run.scene.model.name = options.model;
  run.camera = named_camera(inputs.camera, run.scene, inputs.scene);
  run.scene.fit.free_pivot = run.scene.fit.free_pivot || options.free_pivot;
  if (!inputs.camera.empty()) {
    run.scene.camera.file = inputs.camera.string();
    run.scene.camera.scale_px_per_m.reset();
    run.scene.camera.height_m.reset();
  }
  check_model(run.scene, run.camera, inputs.scene);
  return run;
}

// For want of a camera file the body's own outline tells the camera, if it can. What is wrong with
// the recording itself is left to the tracker to say.
std::optional<tracking::BodyCamera> told_by_body(const RunOptions& options, data::Scene scene,
                                                 std::string& why_not) {
  if (!options.choices.from.empty()) scene.tracking.from = options.choices.from;
  if (!options.choices.to.empty()) scene.tracking.to = options.choices.to;
  try {
    return camera_by_body(options.inputs.video, scene);
  } catch (const Error& error) {
    why_not = error.what();
    return std::nullopt;
  }
}

void calibrate(Run& run, const RunOptions& options, const fs::path& folder) {
  run.camera_note = run.camera ? "" : way_to_a_camera(run.scene);
  const bool quick = options.choices.effort == tracking::Effort::quick;
  if (run.camera_note.empty() || quick) return;
  run.timed("calibrate", [&] {
    std::string why_not;
    const auto found = told_by_body(options, run.scene, why_not);
    run.camera_note = "the body does not tell the camera: " + why_not;
    if (!found) return;
    const fs::path file = folder / "camera.json";
    data::write_camera(found->camera, file);
    run.camera = data::read_camera(file);
    run.scene.camera.file = file.string();
    run.told_by_body = true;
    run.camera_note = fmt::format(
        "no camera was given; one that looks straight down is taken from the body's own outline "
        "(rms {:.2f} px): {}; pictures of a board or a height by tape (trochoid calibrate) tell it "
        "better",
        found->rms_px, overhead_words(found->camera));
  });
}

void track(Run& run, const RunOptions& options) {
  Progress progress("track");
  tracking::TrackOptions how = track_options(run.scene, options.choices);
  how.progress = [&](std::int64_t done, std::int64_t total) { progress.update(done, total); };
  run.tracked = tracking::track_video(options.inputs.video, run.scene, run.camera, how);
  run.tracked.file.made_by = "trochoid " TROCHOID_VERSION;
  if (!run.camera_note.empty()) run.tracked.file.notes.push_back(run.camera_note);
}

fs::path track_file(const RunOptions& options, const fs::path& folder) {
  return folder / (stem_of(options) + ".track.csv");
}

// What is fitted is what is written: a fit of the file alone says the same to the last digit.
void keep_track(Run& run, const RunOptions& options, const fs::path& folder) {
  const fs::path file = track_file(options, folder);
  data::write_track(run.tracked.file, file);
  run.tracked.file = data::read_track(file);
}

fitting::FitOptions fit_options(const RunOptions& options, Progress& progress) {
  fitting::FitOptions how;
  how.free_pivot = options.free_pivot;
  how.seed = options.seed;
  if (options.choices.effort == tracking::Effort::exact) {
    how.profile = true;
    how.bootstrap = 200;
  }
  how.progress = [&progress](const std::string& stage) { progress.update(stage); };
  return how;
}

// A scene that names its model must be able to feed it; one that does not is fitted if it can be.
void fit(Run& run, const RunOptions& options) {
  if (!has_metres(run.tracked.file)) {
    run.no_fit_reason =
        "there is no scale; give the body's radius, a scale or a camera file in a scene";
    return;
  }
  const bool named = run.scene.model.name != "auto";
  run.scene = with_rows(run.scene);
  Progress progress("fit");
  fitting::FitOptions how = fit_options(options, progress);
  try {
    // The quick way takes the model the support suggests, the others compare what could apply.
    if (named || options.choices.effort == tracking::Effort::quick) {
      run.fit = fitting::fit(run.tracked.file.tracks, run.scene, how);
      if (!named && !run.fit->converged)
        run.fit->warnings.emplace_back(
            "a quick run fits one model, without losses the scene does not list; without --effort "
            "quick the models that make sense are compared");
    } else {
      fitting::Comparison comparison = fitting::compare(run.tracked.file.tracks, run.scene, how);
      run.fit = std::move(comparison.fit);
      run.scene = std::move(comparison.scene);
    }
  } catch (const InputError& error) {
    if (named) throw;
    run.no_fit_reason = error.what();
  }
}

void fit_tracks(Run& run, const RunOptions& options) {
  of_tracks(options.inputs.video.string(),
            [&] { in_scene(options.inputs.scene, [&] { fit(run, options); }); });
}

// What is enough for the motion may be too little for a camera as well.
std::optional<fitting::MotionCamera> camera_by_motion(const Run& run, const RunOptions& options) {
  Progress progress("camera");
  try {
    return fitting::camera_by_motion(run.tracked.file.tracks, *run.fit, run.scene,
                                     fit_options(options, progress));
  } catch (const TrackError&) {
    return std::nullopt;
  }
}

// A camera by the body's outline is known to a per cent or so, and its error shows in the motion:
// that of the model which explains it best tells the camera, and with this one all models are
// fitted anew. Where the best then explains less than before, all stays as it was.
void fit_by_sharper_camera(Run& run, const data::Scene& asked, const RunOptions& options,
                           const fs::path& folder) {
  const auto found = camera_by_motion(run, options);
  if (!found) return;
  const Run before = run;
  const auto keep = [&] {
    data::write_camera(*run.camera, run.scene.camera.file);
    keep_track(run, options, folder);
  };
  run.scene = asked;
  run.camera = found->camera;
  run.tracked.file.tracks = found->tracks;
  run.camera_note = fmt::format(
      "no camera was given; one is taken from the body's own outline, and from its motion as the "
      "model has it: {}; pictures of a board (trochoid calibrate) tell it without a model",
      overhead_words(*run.camera));
  std::replace(run.tracked.file.notes.begin(), run.tracked.file.notes.end(), before.camera_note,
               run.camera_note);
  keep();
  fit_tracks(run, options);
  if (run.fit && run.fit->converged >= before.fit->converged)
    return fitting::allow_for_camera(*found, *run.fit);
  run = before;
  keep();
}

// The scene as the folder keeps it: model settled, camera beside it.
data::Scene kept_scene(const Run& run) {
  data::Scene kept = run.scene;
  if (run.fit && !run.fit->scene_toml.empty())
    kept = data::parse_scene(run.fit->scene_toml, "the fit's scene");
  if (run.fit && kept.model.name == "auto") kept.model.name = run.fit->model;
  kept.camera.file = run.camera ? "camera.json" : "";
  return kept;
}

void write_data(Run& run, const RunOptions& options, const fs::path& folder) {
  const std::string stem = stem_of(options);
  const data::Scene kept = kept_scene(run);
  data::write_text(data::to_toml(kept), folder / "scene.toml");
  if (run.camera) data::write_camera(*run.camera, folder / "camera.json");
  if (!run.fit) return;
  run.fit->scene_toml = data::to_toml(kept);
  run.fit->versions["trochoid"] = TROCHOID_VERSION;
  run.fit->inputs[stem + ".track.csv"] = data::sha256_of_file(track_file(options, folder));
  add_recording(run.fit->inputs, run.tracked.file.source, run.tracked.file.source_sha256,
                stem + ".track.csv");
  if (!options.inputs.scene.empty()) add_checksum(run.fit->inputs, options.inputs.scene);
  if (run.camera) add_checksum(run.fit->inputs, folder / "camera.json");
  data::write_fit(*run.fit, folder / (stem + ".fit.json"));
}

// Shows the part where something was tracked: a clip may be much longer than its motion.
OverlayOptions overlay_options(const Run& run, const RunOptions& options) {
  constexpr double kMostlyTracked = 0.7;
  constexpr std::int64_t kLeadFrames = 20;
  const data::TrackingSettings& scene = run.scene.tracking;
  OverlayOptions how{.from = options.choices.from.empty() ? scene.from : options.choices.from,
                     .to = options.choices.to.empty() ? scene.to : options.choices.to,
                     .slow = options.slow};
  std::int64_t first = std::numeric_limits<std::int64_t>::max(), last = 0;
  for (const data::Track& track : run.tracked.file.tracks) {
    if (track.samples.empty() || track.samples.front().frame < 0) return how;
    first = std::min(first, track.samples.front().frame);
    last = std::max(last, track.samples.back().frame);
  }
  const auto frames = static_cast<double>(run.tracked.summary.frames);
  if (static_cast<double>(last - first + 1) > kMostlyTracked * frames) return how;
  if (how.from.empty())
    how.from = fmt::format("f{}", std::max<std::int64_t>(0, first - kLeadFrames));
  if (how.to.empty()) how.to = fmt::format("f{}", last + kLeadFrames);
  return how;
}

void show(Run& run, const RunOptions& options, const fs::path& folder) {
  OverlayInput input;
  input.video = options.inputs.video;
  input.tracks = run.tracked.file;
  input.fit = run.fit;
  input.scene = run.scene;
  input.scene->camera.file.clear();
  input.camera = run.camera;
  const OverlayOptions how = overlay_options(run, options);
  write_still(input, how, folder / "path.png");
  write_residual_picture(input, folder / "residuals.png");
  run.overlay = write_overlay(input, how, folder / "overlay.mp4");
}

std::string command_line(const RunOptions& options) {
  std::string line = "trochoid run " + shell_quoted(options.inputs.video);
  const auto add = [&](const char* name, const std::string& value) {
    if (!value.empty()) line += fmt::format(" {} {}", name, shell_quoted(value));
  };
  const TrackChoices& choices = options.choices;
  add("--scene", options.inputs.scene);
  add("--camera", options.inputs.camera);
  add("--model", options.model);
  if (choices.at_px) add("--at", fmt::format("{},{}", choices.at_px->x(), choices.at_px->y()));
  add("--from", choices.from);
  add("--to", choices.to);
  if (choices.objects) add("--objects", std::to_string(*choices.objects));
  if (choices.rate_hz) add("--rate", fmt::format("{}", *choices.rate_hz));
  if (choices.effort != tracking::Effort::normal) add("--effort", effort_name(choices.effort));
  if (options.free_pivot) line += " --free-pivot";
  if (options.slow > 0.0) add("--slow", fmt::format("{}", options.slow));
  if (options.seed != 1) add("--seed", std::to_string(options.seed));
  add("-o", options.output);
  return line;
}

void write_run_file(const Run& run, const RunOptions& options, const fs::path& folder) {
  nlohmann::ordered_json file;
  file["trochoid"] = TROCHOID_VERSION;
  const fs::path video = fs::absolute(options.inputs.video).lexically_normal();
  file["video"] = (video.parent_path().filename() / video.filename()).string();
  file["stem"] = stem_of(options);  // of the names of track, fit and timing
  file["command"] = command_line(options);
  file["frames"] = run.tracked.summary.frames;
  file["found"] = run.tracked.summary.found;
  file["lost"] = run.tracked.summary.lost;
  file["doubtful"] = run.tracked.summary.doubtful;
  file["damaged"] = run.tracked.summary.damaged;
  file["no_fit_reason"] = run.no_fit_reason;
  file["overlay"] = {{"frame_rate_hz", run.overlay.frame_rate_hz},
                     {"slowed", run.overlay.slowed},
                     {"t_s", run.overlay.t_s}};
  data::write_text(json_text(file) + "\n", folder / kRunFile);
}

void write_times(const Run& run, const RunOptions& options, const fs::path& folder) {
  data::write_text(run.times.dump(1) + "\n", folder / (stem_of(options) + ".timing.json"));
}

/// A short answer for people on stdout, or the same as JSON.
void tell(const Run& run, const Verdict& verdict, const RunOptions& options) {
  const fs::path folder = folder_of(options);
  if (options.json) {
    nlohmann::ordered_json summary{{"folder", folder.string()},
                                   {"report", (folder / "report.html").string()},
                                   {"verdict", verdict.sentence},
                                   {"grade", verdict.grade},
                                   {"frames", run.tracked.summary.frames},
                                   {"found", run.tracked.summary.found},
                                   {"notes", run.tracked.file.notes},
                                   {"times", run.times}};
    if (run.fit) {
      summary["model"] = run.fit->model;
      summary["converged"] = run.fit->converged;
      summary["recommendation"] = run.fit->recommendation;
      summary["fit"] = (folder / (stem_of(options) + ".fit.json")).string();
    }
    print_json(summary);
    return;
  }
  fmt::print("{}: {}\n", verdict.word, verdict.sentence);
  if (run.fit)
    for (const data::FitParameter& p : run.fit->parameters)
      if (p.status != data::ParameterStatus::fixed && p.name.find('@') == std::string::npos)
        fmt::print("  {:<26} {} {}{}\n", p.name,
                   p.identifiable ? value_words(p.value, p.sigma) : "not seen by the data",
                   p.identifiable ? unit_words(p.unit) : "",
                   p.status == data::ParameterStatus::free      ? ""
                   : p.status == data::ParameterStatus::derived ? "   (derived)"
                                                                : "   (from the prior)");
  if (run.fit && !run.fit->recommendation.empty()) fmt::print("  {}\n", run.fit->recommendation);
  for (const std::string& remark : verdict.remarks) fmt::print("  note: {}\n", remark);
  fmt::print("Open {}\n", (folder / "report.html").string());
  fmt::print("also {}, {}{}\n", (folder / "overlay.mp4").string(), (folder / "path.png").string(),
             run.fit ? ", " + (folder / "residuals.png").string() : "");
}

/// All files of the folder.
Verdict write_all(Run& run, const RunOptions& options, const fs::path& folder) {
  write_data(run, options, folder);
  run.timed("overlay", [&] { show(run, options, folder); });
  write_run_file(run, options, folder);
  write_times(run, options, folder);
  Verdict verdict;
  run.timed("report", [&] {
    const ReportInput input = read_run_folder(folder);
    verdict = judge(gather(input));
    data::write_text(make_report(input), folder / "report.html");
    data::write_text(make_path_svg(input), folder / "path.svg");
  });
  write_times(run, options, folder);
  return verdict;
}

void run(const RunOptions& options) {
  Run run = prepared(options);
  check_replaceable(folder_of(options),
                    {options.inputs.video, options.inputs.scene, options.inputs.camera});
  PendingFolder pending(folder_of(options));
  pending.told_by_its_name([&] { calibrate(run, options, pending.path()); });
  run.timed("track", [&] { track(run, options); });
  pending.told_by_its_name([&] { keep_track(run, options, pending.path()); });
  const data::Scene asked = run.scene;
  run.timed("fit", [&] { fit_tracks(run, options); });
  if (run.told_by_body && run.fit)
    run.timed("sharper_camera",
              [&] { fit_by_sharper_camera(run, asked, options, pending.path()); });
  const Verdict verdict =
      pending.told_by_its_name([&] { return write_all(run, options, pending.path()); });
  pending.commit();
  tell(run, verdict, options);
  check_found(run.tracked.file, run.scene.tracking.objects);
  if (run.fit && !run.fit->converged)
    throw NotGood(fmt::format("the fit is not good: {}", run.fit->reason));
}

std::shared_ptr<RunOptions> add_options(CLI::App& command) {
  auto options = std::make_shared<RunOptions>();
  add_track_options(command, options->inputs, options->choices,
                    "quick: fewer edges, no camera from the outline, one model; normal: compare "
                    "models; exact: all edges, also profile likelihoods and bootstrap");
  command.add_option("-o,--output", options->output,
                     "Folder to make (default: VIDEO's name with .trochoid)");
  command
      .add_option("--model", options->model,
                  "Model to fit, instead of the scene's; auto: compare those that make sense")
      ->check(fitted_model());
  command.add_flag("--free-pivot", options->free_pivot,
                   "Also fit where the pivot is, x and y (model top)");
  command
      .add_option("--slow", options->slow,
                  "Overlay plays this many times slower (default: at most 60 frames/s)")
      ->check(number_within(0.01, 1000.0));
  command.add_option("--seed", options->seed, "Seed of everything random [1]")->check(seed());
  add_json_flag(command, options->json);
  return options;
}

}  // namespace

void check_run(const std::vector<std::string>& words) {
  CLI::App command;
  const auto options = add_options(command);
  try {
    command.parse(std::vector<std::string>(words.rbegin(),
                                           words.rend()));  // from the back, as CLI11 wants them
  } catch (const CLI::ParseError& error) {
    throw InputError(error.what());
  }
  const std::string video = options->inputs.video;
  const bool numbered = video.find('%') != std::string::npos;  // img/%04d.png
  if (!numbered && !fs::exists(video)) throw InputError(fmt::format("{}: no such file", video));
  (void)prepared(*options);
}

void add_run_command(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "run", "Track, fit, overlay and report: a recording in, a folder with everything out");
  const auto options = add_options(*command);
  command->footer(
      "Example:\n  trochoid run ring.mp4 --scene ring.toml\nwrites ring.trochoid/; open "
      "ring.trochoid/report.html. Without a camera it takes one that looks straight "
      "down from the outline of the body.");
  command->callback([options] { run(*options); });
}

}  // namespace trochoid::tools
