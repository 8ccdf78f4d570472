#include <fmt/core.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "commands.hpp"
#include "common/child_process.hpp"
#include "common/outputs.hpp"
#include "study/tracking_baselines.hpp"
#include "study/tracking_scores.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

// study tracking: track recordings with truth or labels from scratch and score the tracks.
namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

/// Beside a recording's name: the track of what was pointed at.
constexpr const char* kPointed = ".pointed";

struct TrackingStudyOptions {
  std::vector<fs::path> folders;
  fs::path out = "study-tracking";
  bool baselines = false;
};

/// A folder of either layout.
struct Recording {
  std::string name;
  fs::path video;
  fs::path truth, camera, object;  ///< rendered layout
  std::vector<fs::path> labels;    ///< real layout: reference_*.csv
  [[nodiscard]] bool rendered() const { return !truth.empty(); }
};

bool is_video(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  constexpr std::array kKnown{".mp4", ".mov", ".avi", ".mkv", ".webm", ".m4v", ".mpg", ".ts"};
  return std::any_of(kKnown.begin(), kKnown.end(), [&](const char* e) { return extension == e; });
}

Recording recording_in(const fs::path& folder) {
  if (!fs::is_directory(folder))
    throw InputError(fmt::format("{}: no such folder", folder.string()));
  Recording r;
  r.name = fs::weakly_canonical(folder).filename().string();
  std::vector<fs::path> videos;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const fs::path& path = entry.path();
    const std::string file = path.filename().string();
    if (is_video(path)) videos.push_back(path);
    if (file.starts_with("reference_") && path.extension() == ".csv") r.labels.push_back(path);
  }
  std::sort(r.labels.begin(), r.labels.end());
  if (fs::exists(folder / "truth.csv") && fs::exists(folder / "video.mp4")) {
    r.video = folder / "video.mp4";
    r.truth = folder / "truth.csv";
    for (const char* needed : {"camera.json", "object.json"})
      if (!fs::exists(folder / needed))
        throw InputError(
            fmt::format("{}: {} is missing beside truth.csv", folder.string(), needed));
    r.camera = folder / "camera.json";
    r.object = folder / "object.json";
    // What is wrong with these is told before anything is tracked.
    static_cast<void>(data::read_camera(r.camera));
    static_cast<void>(data::read_object(r.object));
    return r;
  }
  if (videos.size() != 1)
    throw InputError(
        fmt::format("{}: holds {} videos; expected video.mp4 with truth.csv, or one "
                    "video with reference_*.csv",
                    folder.string(), videos.size()));
  r.video = videos.front();
  return r;
}

/// The track command as a user would run it, in a process of its own: its time and memory are the
/// program's, start and files included.
ChildRun track(const Recording& r, const fs::path& out, const fs::path& target,
               const std::vector<std::string>& help = {}) {
  std::vector<std::string> arguments{own_path(), "track", r.video.string(), "-o", target.string()};
  arguments.insert(arguments.end(), help.begin(), help.end());
  if (r.rendered()) {
    data::Scene scene = data::read_object(r.object);
    scene.camera.file = fs::absolute(r.camera).string();
    const fs::path file = out / (r.name + ".scene.toml");
    data::write_text(data::to_toml(scene), file);
    arguments.insert(arguments.end(), {"--scene", file.string()});
  } else if (r.labels.size() > 1) {
    arguments.insert(arguments.end(), {"--objects", std::to_string(r.labels.size())});
  }
  return run_child(arguments);
}

std::string cell(double value, int digits) {
  return std::isfinite(value) ? fmt::format("{:.{}f}", value, digits) : "-";
}

/// On the floor; a usual size where nothing is known of the body.
double radius_px(const Recording& r) {
  constexpr double kUsual_px = 30.0;
  if (!r.rendered()) return kUsual_px;
  return px_per_m(data::read_camera(r.camera)) * data::read_object(r.object).body->radius_m;
}

void print_truth(const Recording& r, const data::TrackFile& file) {
  const data::Scene scene = data::read_object(r.object);
  const TruthScore s = score_against_truth(file.tracks.front(), data::read_table(r.truth),
                                           *scene.body, radius_px(r));
  fmt::print("  frames {}: found {}, wrong {}, lost {}\n", s.frames, s.found, s.wrong, s.lost);
  fmt::print("  CoM rms {} px ({} mm), bias {}, {} px ({}, {} mm), largest {} px in frame {}\n",
             cell(s.rms_px, 4), cell(s.rms_mm, 4), cell(s.bias_px.x(), 4), cell(s.bias_px.y(), 4),
             cell(s.bias_mm.x(), 4), cell(s.bias_mm.y(), 4), cell(s.largest_px, 3), s.worst_frame);
  fmt::print("  rms of tilt {} deg, precession {} deg, spin {} deg (tilt 15..75 deg{})\n",
             cell(s.tilt.rms_deg, 3), cell(s.precession.rms_deg, 3), cell(s.spin.rms_deg, 3),
             scene.body->faces_look_alike() ? ", folded" : "");
  fmt::print(
      "  mean squared normalised error {} (tilt {}, precession {}, spin {}; 1 = honest sigmas)\n",
      cell(s.normalised, 3), cell(s.tilt.normalised, 2), cell(s.precession.normalised, 2),
      cell(s.spin.normalised, 2));
}

void print_label_score(const LabelScore& s) {
  fmt::print(
      "  {}: object {}, {} of {} labelled frames found; error / uncertainty rms {}, {}; "
      "bias {}, {} px; worst frame {}\n",
      s.label, s.object, s.found, s.frames, cell(s.rms.x(), 2), cell(s.rms.y(), 2),
      cell(s.bias_px.x(), 3), cell(s.bias_px.y(), 3), s.worst_frame);
  if (s.angles > 0)
    fmt::print("    spin: rms {} deg about a constant offset of {} deg, {} labelled angles\n",
               cell(s.angle_rms_deg, 2), cell(s.angle_offset_deg, 2), s.angles);
}

/// Whether what was labelled is what was tracked.
bool follows(const LabelScore& s) {
  constexpr double kFound = 0.9, kOff = 3.0;
  return s.found >= kFound * s.frames && s.rms.maxCoeff() <= kOff;
}

/// Where the tracker follows something else than what was labelled (another rim of the body, say):
/// what it makes of it when pointed at it, from the earliest of a few labelled frames that will do.
void print_pointed(const Recording& r, const data::Table& labels,
                   const TrackingStudyOptions& options) {
  constexpr Eigen::Index kTries = 8;
  const fs::path target = options.out / (r.name + kPointed + ".track.csv");
  const Eigen::VectorXd frame = labels.column("frame"), x = labels.column("x_px"),
                        y = labels.column("y_px");
  for (Eigen::Index k = 0; k < kTries; ++k) {
    const Eigen::Index row = k * frame.size() / kTries;
    const auto first = static_cast<std::int64_t>(frame[row]);
    const ChildRun run =
        track(r, options.out, target,
              {"--from", fmt::format("f{}", first), "--at", fmt::format("{},{}", x[row], y[row])});
    if (run.exit_status != 0 && run.exit_status != 3) continue;
    LabelScore s =
        score_against_labels(data::read_track(target), labels,
                             fmt::format("pointed at its label in frame {}", first), first);
    if (!follows(s)) continue;
    print_label_score(s);
    return;
  }
  fs::remove(target);
  fmt::print("  pointed at its labels: not followed from any of {} of them\n", kTries);
}

void print_labels(const Recording& r, const data::TrackFile& file,
                  const TrackingStudyOptions& options) {
  for (const fs::path& path : r.labels) {
    const data::Table labels = data::read_table(path);
    const LabelScore s = score_against_labels(file, labels, path.stem().string());
    print_label_score(s);
    if (r.labels.size() == 1 && !follows(s)) print_pointed(r, labels, options);
  }
}

void print_speed(const ChildRun& ours, const ChildRun& ffmpeg, std::int64_t frames) {
  const auto count = static_cast<double>(frames);
  if (!ffmpeg.started || ffmpeg.exit_status != 0) {
    fmt::print("  {:.0f} frames/s; peak memory {:.0f} MB (no ffmpeg to compare with)\n",
               count / ours.seconds, ours.peak_mb);
    return;
  }
  fmt::print("  {:.0f} frames/s, ffmpeg -f null {:.0f}: ratio {:.2f}; peak memory {:.0f} MB\n",
             count / ours.seconds, count / ffmpeg.seconds, ffmpeg.seconds / ours.seconds,
             ours.peak_mb);
}

/// Frames of the recording, from the timing file that the track command leaves.
std::int64_t frames_tracked(fs::path track_file) {
  const std::string timing = data::read_text(track_file.replace_extension(".timing.json"));
  return nlohmann::json::parse(timing).at("frames").get<std::int64_t>();
}

/// False if the recording could not be tracked.
bool study(const Recording& r, const TrackingStudyOptions& options) {
  const fs::path target = options.out / (r.name + ".track.csv");
  fmt::print("{}\n", r.name);
  std::fflush(stdout);
  const ChildRun ours = track(r, options.out, target);
  const ChildRun ffmpeg =
      run_child({"ffmpeg", "-v", "error", "-nostdin", "-i", r.video.string(), "-f", "null", "-"});
  if (ours.exit_status != 0 && ours.exit_status != 3) {
    const std::string why = last_line(ours.error_output);
    fmt::print("  refused: {}\n", why.empty() ? "no reason given" : why);
    return false;
  }
  const data::TrackFile file = data::read_track(target);
  if (r.rendered())
    print_truth(r, file);
  else if (!r.labels.empty())
    print_labels(r, file, options);
  else
    fmt::print("  no truth and no labels: tracked only, {} bodies\n", file.tracks.size());
  for (const std::string& note : file.notes) fmt::print("  note: {}\n", note);
  print_speed(ours, ffmpeg, frames_tracked(target));
  if (options.baselines) print_baselines(r.video, r.truth, r.labels, radius_px(r));
  return true;
}

/// All of them before the first is tracked, which takes its time.
std::vector<Recording> recordings_in(const std::vector<fs::path>& folders) {
  std::map<std::string, fs::path> named;  // tracks that will be written, without their extension
  std::vector<Recording> recordings;
  for (const fs::path& folder : folders) {
    // What a shell's * brings along: a README beside the folders.
    if (fs::is_regular_file(folder)) continue;
    recordings.push_back(recording_in(folder));
    const std::string& name = recordings.back().name;
    for (const std::string& track : {name, name + kPointed}) {
      const auto [other, is_new] = named.emplace(track, folder);
      if (is_new) continue;
      if (fs::equivalent(other->second, folder))
        throw InputError(fmt::format("{}: is given twice", folder.string()));
      throw InputError(fmt::format(
          "{} and {}: both tracks would be {}.track.csv; score the folders one after the other, "
          "each with its own --out",
          other->second.string(), folder.string(), track));
    }
  }
  if (recordings.empty())
    throw InputError("no folder among what is given; a folder holds one recording each");
  return recordings;
}

void run(const TrackingStudyOptions& options) {
  const std::vector<Recording> recordings = recordings_in(options.folders);
  make_folder(options.out);
  int refused = 0;
  for (const Recording& recording : recordings)
    if (!study(recording, options)) ++refused;
  if (refused > 0)
    throw NotGood(
        fmt::format("{} of {} recordings could not be tracked", refused, recordings.size()));
}

}  // namespace

void add_study_tracking(CLI::App& study_command) {
  auto options = std::make_shared<TrackingStudyOptions>();
  CLI::App* command = study_command.add_subcommand(
      "tracking", "Track recordings with truth.csv or reference_*.csv and score the tracks");
  command->add_option("folders", options->folders, "Folders with one recording each")->required();
  command->add_option("--out", options->out, "Folder for the tracks, NAME.track.csv")
      ->capture_default_str();
  command->add_flag("--baselines", options->baselines,
                    "Also score OpenCV's usual ways: background subtraction, HoughCircles");
  command->footer("Example: trochoid study tracking data/samples/*/");
  command->callback([options] { run(*options); });
}

}  // namespace trochoid::tools
