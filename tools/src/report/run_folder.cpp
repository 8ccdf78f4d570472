#include "report/run_folder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "common/fitted_scene.hpp"
#include "common/json_object.hpp"
#include "common/outputs.hpp"
#include "common/provenance.hpp"
#include "common/recording_name.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

Json results_in(const fs::path& path) {
  std::optional<Json> value = read_json_object(path);
  if (!value)
    throw InputError(
        fmt::format("{}: is not a JSON object; run the recording again", path.string()));
  return *std::move(value);
}

// The only file of the folder whose name ends like this; nothing if there is none.
std::optional<fs::path> file_ending(const fs::path& folder, const std::string& ending) {
  std::optional<fs::path> found;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (!name.ends_with(ending) || name.starts_with('.')) continue;
    if (found)
      throw InputError(fmt::format("{}: holds {} and {}; a report needs one {}", folder.string(),
                                   found->filename().string(), name, ending));
    found = entry.path();
  }
  return found;
}

template <class Value>
Value value_or(const Json& object, const char* key, Value otherwise) {
  const auto found = object.find(key);
  if (found == object.end()) return otherwise;
  try {
    return found->get<Value>();
  } catch (const Json::exception&) {
    throw InputError(
        fmt::format("{}: '{}' is not what a run writes; run the recording again", kRunFile, key));
  }
}

void read_facts(const Json& run, ReportInput& input) {
  input.title = value_or<std::string>(run, "video", input.title);
  input.command = value_or<std::string>(run, "command", "");
  input.no_fit_reason = value_or<std::string>(run, "no_fit_reason", "");
  input.frames = value_or<std::int64_t>(run, "frames", 0);
  const Json overlay = value_or<Json>(run, "overlay", Json::object());
  if (!overlay.is_object()) return;
  input.video_rate_hz = value_or<double>(overlay, "frame_rate_hz", 0.0);
  input.video_t_s = value_or<std::vector<double>>(overlay, "t_s", {});
}

// Beginning of the names of the track, the fit and the times that a run left.
std::string stem_of_run(const fs::path& folder) try {
  const Json run = results_in(folder / kRunFile);
  return value_or(run, "stem", recording_name(value_or<std::string>(run, "video", "")));
} catch (const InputError&) {
  throw InputError(
      fmt::format("{}: exists, and its {} cannot be read; remove the folder, or name "
                  "another with -o",
                  folder.string(), kRunFile));
}

// A file of somebody else's would go with the folder that a run replaces.
void check_holds_results_only(const fs::path& folder) {
  std::vector<std::string> results{kRunFile,      "scene.toml",    "camera.json",
                                   "overlay.mp4", "report.html",   "path.png",
                                   "path.svg",    "residuals.png", ".DS_Store"};
  const std::string stem = stem_of_run(folder);
  for (const char* ending : {".track.csv", ".fit.json", ".timing.json", ".track.timing.json",
                             ".fit.timing.json"})  // the last two where track or fit were repeated
    results.push_back(stem + ending);
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const std::string name = as_utf8(entry.path().filename().string());  // as run.json has the stem
    if (std::find(results.begin(), results.end(), name) == results.end() ||
        !entry.is_regular_file())
      throw InputError(
          fmt::format("{}: holds {}, which no run has written and a new one would remove; move it, "
                      "or name another folder with -o",
                      folder.string(), name));
  }
}

// What a run reads stays as it is.
void check_holds_none_of(const std::vector<fs::path>& inputs, const fs::path& folder) {
  const fs::path own = fs::weakly_canonical(folder);
  for (const fs::path& input : inputs)
    if (!input.empty() && fs::weakly_canonical(input).parent_path() == own)
      throw InputError(
          fmt::format("{}: is read by this run, which would replace the folder it lies in; copy it "
                      "elsewhere, or name another folder with -o",
                      input.string()));
}

}  // namespace

void check_replaceable(const fs::path& folder, const std::vector<fs::path>& inputs) {
  refuse_dash(folder);
  std::error_code code;
  if (fs::exists(folder, code) && !fs::exists(folder / kRunFile, code) &&
      !(fs::is_directory(folder, code) && fs::is_empty(folder, code)))
    throw InputError(
        fmt::format("{}: exists and is not the folder of an earlier run; name another with -o",
                    folder.string()));
  if (!fs::is_directory(folder, code) || fs::is_empty(folder, code)) return;
  check_holds_none_of(inputs, folder);
  check_holds_results_only(folder);
}

ReportInput read_run_folder(const fs::path& folder) {
  std::error_code code;
  if (!fs::is_directory(folder, code))
    throw InputError(
        fmt::format("{}: is not a folder; name the one a run has made", folder.string()));
  const auto track = file_ending(folder, ".track.csv");
  if (!track)
    throw InputError(
        fmt::format("{}: holds no *.track.csv; name the folder of a run", folder.string()));
  ReportInput input;
  input.tracks = data::read_track(*track);
  input.title = input.tracks.source.empty() ? track->filename().string() : input.tracks.source;
  input.checksums[track->filename().string()] = data::sha256_of_file(*track);
  if (const auto fit = file_ending(folder, ".fit.json")) {
    input.fit = data::read_fit(*fit);
    check_made_from(*input.fit, *fit, *track);
  }
  if (fs::exists(folder / "scene.toml", code)) {
    input.scene = data::read_scene(folder / "scene.toml");
    input.scene->camera.file = fs::path(input.scene->camera.file).filename().string();
  }
  if (fs::exists(folder / "overlay.mp4", code)) input.video = folder / "overlay.mp4";
  if (fs::exists(folder / kRunFile, code)) read_facts(results_in(folder / kRunFile), input);
  const std::string stem = track->stem().stem().string();
  if (const fs::path timing = folder / (stem + ".timing.json"); fs::exists(timing, code)) {
    const Json times = results_in(timing);
    for (const auto& [stage, seconds] : times.items())
      if (seconds.is_number() && stage.ends_with("_s"))
        input.times_s.emplace_back(stage.substr(0, stage.size() - 2), seconds.get<double>());
  }
  return input;
}

data::Scene scene_with_camera(const data::Fit& fit, const fs::path& fit_file) {
  data::Scene scene = scene_of(fit, fit_file.string());
  // A run leaves the camera beside the fit and names it so; a fit of its own names it as the scene
  // did, and both may have been moved.
  const fs::path named = scene.camera.file, folder = fit_file.parent_path();
  std::error_code code;
  if (!named.empty())
    for (const fs::path& camera : {folder / named, named, folder / named.filename()})
      if (fs::exists(camera, code)) {
        scene.camera.file = camera.string();
        break;
      }
  return scene;
}

}  // namespace trochoid::tools
