#include "tracking_chain.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>

#include "child_process.hpp"
#include "tracking_scores.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

constexpr std::array<const char*, 3> kEfforts{"quick", "normal", "exact"};
constexpr std::array<int, 3> kReductions{1, 2, 4};  // pictures of 1 / this the width

struct Row {
  std::string recording, effort;
  int reduction = 1;
  TruthScore score;
  double frames_per_s = 0.0, peak_mb = 0.0;
};

/// Pixel centres are integers: the corner of a pixel, half a pixel off, is what scales.
data::Camera reduced(data::Camera camera, int reduction) {
  const double by = 1.0 / reduction;
  camera.fx *= by;
  camera.fy *= by;
  camera.cx = (camera.cx + 0.5) * by - 0.5;
  camera.cy = (camera.cy + 0.5) * by - 0.5;
  // Even sizes: colour is stored at half of them.
  camera.width_px = reduction > 1 ? camera.width_px / reduction / 2 * 2 : camera.width_px;
  camera.height_px = reduction > 1 ? camera.height_px / reduction / 2 * 2 : camera.height_px;
  return camera;
}

/// Truth in pixels of the smaller picture.
data::Table reduced(data::Table truth, int reduction) {
  for (const char* name : {"x_px", "y_px"})
    if (truth.has(name)) {
      const auto place = std::find(truth.columns.begin(), truth.columns.end(), name);
      auto column = truth.values.col(place - truth.columns.begin());
      column = ((column.array() + 0.5) / reduction - 0.5).matrix().eval();
    }
  return truth;
}

/// A folder of this process alone, gone at the end.
struct WorkFolder {
  explicit WorkFolder(const fs::path& target) : path(data::pending_neighbour(target)) {
    fs::create_directories(path);
  }
  WorkFolder(const WorkFolder&) = delete;
  WorkFolder& operator=(const WorkFolder&) = delete;
  ~WorkFolder() { data::discard_pending(path); }
  fs::path path;
};

/// The recording at a fraction of its size, everything `track` needs beside it.
struct Smaller {
  fs::path video, scene;
  data::Camera camera;
};

Smaller make_smaller(const fs::path& folder, int reduction, const fs::path& work) {
  Smaller made{folder / "video.mp4", work / fmt::format("at_{}.toml", reduction),
               data::read_camera(folder / "camera.json")};
  if (reduction > 1) {
    made.video = work / fmt::format("at_{}.mkv", reduction);
    const ChildRun run = run_child(
        {"ffmpeg", "-v", "error", "-nostdin", "-y", "-i", (folder / "video.mp4").string(), "-vf",
         fmt::format(
             "crop=trunc(iw/{0}/2)*2*{0}:trunc(ih/{0}/2)*2*{0}:0:0,scale=iw/{0}:ih/{0}:flags=area",
             reduction),
         "-c:v", "libx264", "-qp", "8", "-preset", "veryfast", made.video.string()});
    if (!run.started || run.exit_status != 0)
      throw InputError("study chain needs the ffmpeg program to make smaller pictures: " +
                       run.error_output);
  }
  made.camera = reduced(made.camera, reduction);
  const fs::path camera_file = work / fmt::format("at_{}.json", reduction);
  data::write_camera(made.camera, camera_file);
  data::Scene scene = data::read_object(folder / "object.json");
  scene.camera.file = fs::absolute(camera_file).string();
  data::write_text(data::to_toml(scene), made.scene);
  return made;
}

std::optional<Row> measure(const fs::path& folder, const Smaller& made, int reduction,
                           const char* effort, const fs::path& work) {
  const fs::path track = work / "track.csv";
  fs::remove(track);
  const ChildRun run = run_child({own_path(), "track", made.video.string(), "--scene",
                                  made.scene.string(), "--effort", effort, "-o", track.string()});
  if (!fs::exists(track)) return std::nullopt;
  const data::TrackFile file = data::read_track(track);
  const data::Scene scene = data::read_object(folder / "object.json");
  const double px_per_m =
      made.camera.jacobian_px_per_m({0.0, 0.0, 0.0}).leftCols<2>().norm() / std::sqrt(2.0);
  const data::Table truth = reduced(data::read_table(folder / "truth.csv"), reduction);
  Row row{.recording = fs::weakly_canonical(folder).filename().string(),
          .effort = effort,
          .reduction = reduction,
          .score = score_against_truth(file.tracks.front(), truth, *scene.body,
                                       px_per_m * scene.body->radius_m)};
  row.frames_per_s = static_cast<double>(truth.values.rows()) / run.seconds;
  row.peak_mb = run.peak_mb;
  return row;
}

Axes diagram(const std::vector<Row>& rows) {
  Axes axes{.title = "Tracking: effort (quick, normal, exact) and resolution",
            .x_label = "frames per second",
            .y_label = "rms error of the CoM [mm]",
            .log_x = true,
            .log_y = true,
            .series = {}};
  for (std::size_t i = 0; i < rows.size();) {
    std::vector<double> x, y;
    const Row& first = rows[i];
    for (; i < rows.size() && rows[i].recording == first.recording &&
           rows[i].reduction == first.reduction;
         ++i) {
      x.push_back(rows[i].frames_per_s);
      y.push_back(rows[i].score.rms_mm);
    }
    const auto n = static_cast<Eigen::Index>(x.size());
    axes.series.push_back({.label = first.reduction == 1
                                        ? first.recording
                                        : fmt::format("{} 1/{}", first.recording, first.reduction),
                           .x = Eigen::Map<Eigen::VectorXd>(x.data(), n),
                           .y = Eigen::Map<Eigen::VectorXd>(y.data(), n),
                           .points = true});
  }
  return axes;
}

}  // namespace

Axes study_tracking_chain(const std::vector<fs::path>& folders, const fs::path& out) {
  const WorkFolder folder_of_work(out / "chain");
  const fs::path& work = folder_of_work.path;
  std::vector<Row> rows;
  fmt::print("\n{:<18} {:>10} {:<8} {:>11} {:>6} {:>10} {:>10} {:>10} {:>10} {:>8}\n", "recording",
             "width", "effort", "found", "wrong", "rms px", "rms mm", "tilt deg", "frames/s",
             "peak MB");
  std::string csv =
      "recording,reduction,effort,frames,found,wrong,rms_px,rms_mm,tilt_rms_deg,normalised,"
      "frames_per_s,peak_mb\n";
  for (const fs::path& folder : folders) {
    if (!fs::is_directory(folder)) continue;  // a README beside the folders
    for (const int reduction : kReductions) {
      const Smaller made = make_smaller(folder, reduction, work);
      for (const char* effort : kEfforts) {
        const auto row = measure(folder, made, reduction, effort, work);
        if (!row) {
          fmt::print("{:<18} {:>9}/{} {:<8} not tracked\n", folder.filename().string(), 1,
                     reduction, effort);
          continue;
        }
        const TruthScore& s = row->score;
        fmt::print(
            "{:<18} {:>10} {:<8} {:>5}/{:<5} {:>6} {:>10.4f} {:>10.4f} {:>10.3f} {:>10.0f} "
            "{:>8.0f}\n",
            row->recording, made.camera.width_px, effort, s.found, s.frames, s.wrong, s.rms_px,
            s.rms_mm, s.tilt_rms_deg, row->frames_per_s, row->peak_mb);
        std::fflush(stdout);
        csv += fmt::format("{},{},{},{},{},{},{:.5g},{:.5g},{:.5g},{:.4g},{:.5g},{:.4g}\n",
                           row->recording, reduction, effort, s.frames, s.found, s.wrong, s.rms_px,
                           s.rms_mm, s.tilt_rms_deg, s.normalised, row->frames_per_s, row->peak_mb);
        rows.push_back(*row);
      }
    }
  }
  data::write_text(csv, out / "chain_tracking.csv");
  return diagram(rows);
}

}  // namespace trochoid::tools
