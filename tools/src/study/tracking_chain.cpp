#include "study/tracking_chain.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <string_view>

#include "common/child_process.hpp"
#include "study/tracking_scores.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

constexpr std::array<const char*, 3> kEfforts{"quick", "normal", "exact"};

/// What of the picture is kept, and how finely.
struct ReducedView {
  std::string_view name;
  int reduction;  ///< pictures of 1 / this the width
  bool cut;       ///< to where the body goes
};
constexpr std::array<ReducedView, 4> kViews{
    {{"whole", 1, false}, {"half", 2, false}, {"quarter", 4, false}, {"cut out", 1, true}}};

struct ChainRow {
  std::string recording, effort;
  ReducedView view;
  TruthScore score;
  double frames_per_s = 0.0, peak_mb = 0.0;
};

/// What of the original picture the smaller one shows.
struct PicturePart {
  int x_px = 0, y_px = 0, width_px = 0, height_px = 0;
  int reduction = 1;
};

/// Even sizes and corners: colour is stored at half of them.
int even(double px) {
  return static_cast<int>(px) / 2 * 2;
}

/// Two radii to every side of where the centre goes: the outline never comes near the border.
PicturePart part_of(const ReducedView& view, const data::Camera& camera, const data::Table& truth,
                    double radius_m) {
  const int block = 2 * view.reduction;
  PicturePart part{0, 0, camera.width_px / block * block, camera.height_px / block * block,
                   view.reduction};
  if (!view.cut) return part;
  const double margin_px = 2.0 * radius_m * px_per_m(camera);
  const auto x = truth.column("x_px"), y = truth.column("y_px");
  part.x_px = even(std::max(x.minCoeff() - margin_px, 0.0));
  part.y_px = even(std::max(y.minCoeff() - margin_px, 0.0));
  part.width_px = even(std::min(x.maxCoeff() + margin_px, 1.0 * part.width_px)) - part.x_px;
  part.height_px = even(std::min(y.maxCoeff() + margin_px, 1.0 * part.height_px)) - part.y_px;
  return part;
}

/// Pixel centres are integers: the corner of a pixel, half a pixel off, is what scales.
double shown_at(double px, int from_px, int reduction) {
  return (px - from_px + 0.5) / reduction - 0.5;
}

data::Camera seen_by(data::Camera camera, const PicturePart& part) {
  camera.fx /= part.reduction;
  camera.fy /= part.reduction;
  camera.cx = shown_at(camera.cx, part.x_px, part.reduction);
  camera.cy = shown_at(camera.cy, part.y_px, part.reduction);
  camera.width_px = part.width_px / part.reduction;
  camera.height_px = part.height_px / part.reduction;
  return camera;
}

/// Truth in pixels of the smaller picture.
data::Table seen_in(data::Table truth, const PicturePart& part) {
  for (const auto& [name, from_px] : {std::pair{"x_px", part.x_px}, {"y_px", part.y_px}}) {
    const auto place = std::find(truth.columns.begin(), truth.columns.end(), name);
    for (double& px : truth.values.col(place - truth.columns.begin()))
      px = shown_at(px, from_px, part.reduction);
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

/// A recording with everything `track` and its judging need.
struct ChainRecording {
  fs::path video, scene;
  data::Camera camera;
  data::Table truth;
  data::Body body;
};

ChainRecording make_view(const fs::path& folder, const ReducedView& view, const fs::path& work) {
  data::Scene scene = data::read_object(folder / "object.json");
  const data::Camera camera = data::read_camera(folder / "camera.json");
  const data::Table truth = data::read_table(folder / "truth.csv");
  const PicturePart part = part_of(view, camera, truth, scene.body->radius_m);
  ChainRecording made{folder / "video.mp4", work / "view.toml", seen_by(camera, part),
                      seen_in(truth, part), *scene.body};
  if (view.reduction > 1 || view.cut) {
    made.video = work / "view.mkv";
    const ChildRun run = run_child(
        {"ffmpeg", "-v", "error", "-nostdin", "-y", "-i", (folder / "video.mp4").string(), "-vf",
         fmt::format("crop={}:{}:{}:{},scale={}:{}:flags=area", part.width_px, part.height_px,
                     part.x_px, part.y_px, made.camera.width_px, made.camera.height_px),
         "-c:v", "libx264", "-qp", "8", "-preset", "veryfast", made.video.string()});
    if (!run.started || run.exit_status != 0)
      throw InputError("study chain needs the ffmpeg program to make smaller pictures: " +
                       last_line(run.error_output));
  }
  const fs::path camera_file = work / "view.json";
  data::write_camera(made.camera, camera_file);
  scene.camera.file = fs::absolute(camera_file).string();
  data::write_text(data::to_toml(scene), made.scene);
  return made;
}

std::optional<ChainRow> measure(const ChainRecording& made, const char* effort,
                                const fs::path& work) {
  const fs::path track = work / "track.csv";
  fs::remove(track);
  const ChildRun run = run_child({own_path(), "track", made.video.string(), "--scene",
                                  made.scene.string(), "--effort", effort, "-o", track.string()});
  if (!fs::exists(track)) return std::nullopt;
  const data::TrackFile file = data::read_track(track);
  ChainRow row;
  row.effort = effort;
  row.score = score_against_truth(file.tracks.front(), made.truth, made.body,
                                  px_per_m(made.camera) * made.body.radius_m);
  row.frames_per_s = static_cast<double>(made.truth.values.rows()) / run.seconds;
  row.peak_mb = run.peak_mb;
  return row;
}

Axes diagram(const std::vector<ChainRow>& rows) {
  Axes axes{.title = "Tracking: effort (quick, normal, exact), resolution, part of the picture",
            .x_label = "frames per second",
            .y_label = "rms error of the CoM [mm]",
            .log_x = true,
            .log_y = true,
            .series = {}};
  for (std::size_t i = 0; i < rows.size();) {
    std::vector<double> x, y;
    const ChainRow& first = rows[i];
    for (; i < rows.size() && rows[i].recording == first.recording &&
           rows[i].view.name == first.view.name;
         ++i) {
      x.push_back(rows[i].frames_per_s);
      y.push_back(rows[i].score.rms_mm);
    }
    const auto n = static_cast<Eigen::Index>(x.size());
    axes.series.push_back({.label = fmt::format("{}, {}", first.recording, first.view.name),
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
  std::vector<ChainRow> rows;
  fmt::print("\n{:<18} {:<8} {:>9} {:<8} {:>11} {:>6} {:>8} {:>8} {:>9} {:>9} {:>8}\n", "recording",
             "picture", "size", "effort", "found", "wrong", "rms px", "rms mm", "tilt deg",
             "frames/s", "peak MB");
  std::string csv =
      "recording,picture,width_px,height_px,effort,frames,found,wrong,rms_px,rms_mm,tilt_rms_deg,"
      "normalised,tilt_normalised,frames_per_s,peak_mb\n";
  for (const fs::path& folder : folders) {
    const std::string name = fs::weakly_canonical(folder).filename().string();
    for (const ReducedView& view : kViews) {
      const ChainRecording made = make_view(folder, view, work);
      const std::string size = fmt::format("{}x{}", made.camera.width_px, made.camera.height_px);
      for (const char* effort : kEfforts) {
        fmt::print("{:<18} {:<8} {:>9} {:<8} ", name, view.name, size, effort);
        auto row = measure(made, effort, work);
        if (!row) {
          fmt::print("not tracked\n");
          continue;
        }
        row->recording = name;
        row->view = view;
        const TruthScore& s = row->score;
        fmt::print("{:>5}/{:<5} {:>6} {:>8.4f} {:>8.4f} {:>9.3f} {:>9.0f} {:>8.0f}\n", s.found,
                   s.frames, s.wrong, s.rms_px, s.rms_mm, s.tilt.rms_deg, row->frames_per_s,
                   row->peak_mb);
        std::fflush(stdout);
        csv += fmt::format(
            "{},{},{},{},{},{},{},{},{:.5g},{:.5g},{:.5g},{:.4g},{:.5g},{:.5g},{:.4g}\n", name,
            view.name, made.camera.width_px, made.camera.height_px, effort, s.frames, s.found,
            s.wrong, s.rms_px, s.rms_mm, s.tilt.rms_deg, s.normalised, s.tilt.normalised,
            row->frames_per_s, row->peak_mb);
        rows.push_back(*row);
      }
    }
  }
  data::write_text(csv, out / "chain_tracking.csv");
  return diagram(rows);
}

}  // namespace trochoid::tools
