#include "link/track_result.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "find/face_border.hpp"
#include "link/rolling_shutter.hpp"
#include "trochoid/data/pose_motion.hpp"

namespace trochoid::tracking {
namespace {

bool measured_as_cylinders(const FollowedRecording& of) {
  return has_shape(of.scene) && of.camera;
}

std::string words_on_cylinders(const FollowedRecording& of) {
  const bool named = of.camera && !of.camera->file.empty();
  return fmt::format(
      "{}: the CoM of the fitted cylinder",
      named ? std::filesystem::path(of.camera->file).filename().string() : "the scene's camera");
}

/// Metres for a track measured by rims: a camera over the floor, or the known radius.
/// @param words  how they are obtained.
std::optional<data::Camera> floor_of_rims(const FollowedRecording& of, const BodyPath& path,
                                          std::string& words) {
  if (of.camera) {
    words = "rim centre projected to the floor by the camera";
    return of.camera;
  }
  if (!has_shape(of.scene)) {
    words = "none: pixels only";
    return std::nullopt;
  }
  const VideoInfo& video = of.recording.info();
  const double scale = usual_radius_px(path) / of.scene.body->radius_m;
  words = fmt::format("scale {:.6g} px/m from the known radius", scale);
  return data::Camera::from_scale(video.width_px, video.height_px, scale);
}

/// In most of the frames that tell.
bool stays_on_a_pin(const data::Scene& scene, const BodyPath& path) {
  int on = 0, off = 0;
  for (const auto& [index, at] : path.frames)
    if (at.seen.pose) ++(is_on_a_pin(*scene.body, scene.support, at.seen.pose->pose) ? on : off);
  return on > off;
}

/// Though it could stand on its rim, it is not seen to lean but by chance.
bool lies_throughout(const data::Scene& scene, const BodyPath& path) {
  constexpr double kClearly = 3.0;  // sigmas
  constexpr double kByChance = 0.05;
  if (scene.support.kind != data::SupportKind::floor || path.frames.empty()) return false;
  const auto leaning = std::count_if(
      path.frames.begin(), path.frames.end(), [](const BodyPath::Frames::value_type& frame) {
        const auto& pose = frame.second.seen.pose;
        return !pose || std::abs(std::sin(pose->pose.theta_rad)) > kClearly * pose->sigma_theta_rad;
      });
  return static_cast<double>(leaning) <= kByChance * static_cast<double>(path.frames.size());
}

std::string note_about_scale(const data::Support& support) {
  return fmt::format(
      "without a camera metres go by how large the body looks, with its shadow{}: off by more "
      "than the error bars say, which a camera file would mend",
      support.kind == data::SupportKind::flat
          ? ""
          : ", and a body that tilts is not where the middle of its rim appears");
}

/// What the outline of a body may have been taken for, where most of its frames show it badly.
std::optional<std::string> note_about_border(const FollowedRecording& of,
                                             const std::vector<BodyPath>& paths,
                                             const TrackOptions& options) {
  constexpr double kBadly = 0.7;  // of the outline, in the usual frame
  constexpr std::size_t kLooks = 5;
  if (paths.empty() || !measured_as_cylinders(of) || of.scene.body->border_radius_m > 0.0)
    return std::nullopt;
  const BodyPath& path = paths.front();
  const double seen = usual_accepted(path);
  if (seen > kBadly) return std::nullopt;
  std::vector<DoubtfulLook> looks;
  for (const Frame& frame : of.recording.window())
    if (const auto at = path.frames.find(frame.index);
        at != path.frames.end() && at->second.seen.pose)
      looks.push_back({&frame, &at->second.seen});
  if (looks.size() < kLooks) return std::nullopt;
  std::vector<DoubtfulLook> some;
  for (std::size_t k = 0; k < kLooks; ++k)
    some.push_back(looks[(2 * k + 1) * looks.size() / (2 * kLooks)]);
  const auto border = likely_border(*of.scene.body, of.scene.support, *of.camera, of.background,
                                    some, options.checkpoint);
  return border ? std::optional(note_about_likely_border(seen, *border)) : std::nullopt;
}

/// What is alike for all bodies.
AssemblyOptions usual_assembly(const FollowedRecording& of) {
  AssemblyOptions how{.readout_s = of.readout_s, .video = of.recording.info()};
  if (of.camera) how.camera = &*of.camera;
  how.shifts = of.shifts;
  if (of.scene.body && !of.scene.body->marks.empty())
    how.mark_rad = of.scene.body->marks.front().angle_rad;
  return how;
}

/// What is one body's own as well.
AssemblyOptions assembly_of(const FollowedRecording& of, const BodyPath& path) {
  const data::Support& support = of.scene.support;
  const bool held = support.kind == data::SupportKind::pivot;
  AssemblyOptions how = usual_assembly(of);
  how.on_pin = stays_on_a_pin(of.scene, path);
  how.flat = support.kind == data::SupportKind::flat;
  // A pivot tells the ends of an axis apart, unless the body turns about it in place.
  how.fold =
      measured_as_cylinders(of) && of.scene.body->faces_look_alike() && (!held || how.on_pin);
  if (held && support.pivot_m && !how.on_pin) how.pivot_m = support.pivot_m->head<2>();
  return how;
}

/// @param alone  whether it is the only body.  @param words  how metres were obtained.
void add_track(const FollowedRecording& of, int object, bool alone, BodyPath& path,
               TrackResult& result, std::string& words) {
  if (measured_as_cylinders(of))
    undo_rolling_shutter({of.readout_s, of.recording.info(), *of.camera}, *of.scene.body,
                         of.scene.support, path);
  std::optional<data::Camera> floor;
  if (!measured_as_cylinders(of)) floor = floor_of_rims(of, path, words);
  const AssemblyOptions how = assembly_of(of, path);
  result.file.angles_folded = result.file.angles_folded || how.fold;
  const data::Track& track =
      result.file.tracks.emplace_back(assemble_track(path, object, floor, how));
  const auto found = static_cast<std::int64_t>(track.samples.size());
  result.summary.found += found;
  result.summary.lost += of.read.frames - found;
  result.summary.doubtful += std::count_if(track.samples.begin(), track.samples.end(),
                                           [](const auto& sample) { return sample.doubtful(); });
  const auto add = [&](const std::optional<std::string>& note) {
    if (note)
      result.file.notes.push_back(alone ? *note : fmt::format("object {}: {}", object, *note));
  };
  add(note_about_lost(path, of.span, of.recording.info()));
  const data::Track at_rest = as_camera_at_rest_sees(track, of.shifts);
  add(note_about_cuts(at_rest, usual_radius_px(path)));
  add(note_about_steps(at_rest, of.scene.camera.missing_frames));
}

/// What is to be known of all tracks, in this order.
std::vector<std::string> notes_about(const FollowedRecording& of,
                                     const std::vector<BodyPath>& paths,
                                     const TrackOptions& options) {
  std::vector<std::string> notes;
  const auto add = [&](std::optional<std::string> note) {
    if (note) notes.push_back(std::move(*note));
  };
  add(note_about_camera_motion(of.shifts, of.read.frames, of.camera || has_shape(of.scene)));
  if (of.camera) add(note_about_edges(paths, *of.camera));
  if (of.seen_exposure)
    add(note_about_seen_exposure(*of.seen_exposure, of.recording.info().frame_rate_hz));
  add(note_about_border(of, paths, options));
  if (!paths.empty() && std::all_of(paths.begin(), paths.end(), [&](const BodyPath& path) {
        return lies_throughout(of.scene, path);
      }))
    notes.emplace_back(
        "it is not seen to lean, as if it lay on its face: with kind = \"flat\" under [support] "
        "a fit takes it for a body that slides, not for one that rolls on its rim");
  if (!of.camera || of.camera->file.empty()) add(note_about_pixel_aspect(of.recording.info()));
  if (!of.camera && has_shape(of.scene)) add(note_about_scale(of.scene.support));
  for (std::string& note : notes_about_recording(of.recording.info(), of.read))
    notes.push_back(std::move(note));
  return notes;
}

}  // namespace

TrackResult make_tracks(const FollowedRecording& followed, std::vector<BodyPath>& paths,
                        const TrackOptions& options) {
  TrackResult result;
  result.file.source = followed.video.filename().string();
  result.summary.frames = followed.read.frames;
  result.summary.damaged = followed.read.damaged;
  std::string words = words_on_cylinders(followed);
  for (std::size_t k = 0; k < paths.size(); ++k)
    add_track(followed, static_cast<int>(k), paths.size() == 1, paths[k], result, words);
  for (std::string& note : notes_about(followed, paths, options))
    result.file.notes.push_back(std::move(note));
  result.file.camera = words;
  result.summary.camera_words = words;
  if (options.edges) result.edges = edge_table(paths);
  return result;
}

}  // namespace trochoid::tracking
