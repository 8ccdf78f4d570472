#include "trochoid/tracking/tracker.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <future>
#include <utility>

#include "attitude_sequence.hpp"
#include "body_search.hpp"
#include "recording.hpp"
#include "track_assembly.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::tracking {
namespace {

namespace fs = std::filesystem;

std::optional<data::Camera> resolve_camera(const data::Scene& scene,
                                           const std::optional<data::Camera>& given,
                                           const VideoInfo& video) {
  std::optional<data::Camera> camera = given;
  if (!camera && !scene.camera.file.empty()) camera = data::read_camera(scene.camera.file);
  if (camera) {
    if (camera->width_px != 0 &&
        (camera->width_px != video.width_px || camera->height_px != video.height_px))
      throw InputError(
          fmt::format("the camera is for {} x {} pictures, the recording has {} x {}; calibrate it "
                      "at this size",
                      camera->width_px, camera->height_px, video.width_px, video.height_px));
    return camera;
  }
  if (!scene.camera.scale_px_per_m) return std::nullopt;
  const double scale = *scene.camera.scale_px_per_m;
  return scene.camera.height_m ? data::Camera::overhead(video.width_px, video.height_px, scale,
                                                        *scene.camera.height_m)
                               : data::Camera::from_scale(video.width_px, video.height_px, scale);
}

bool has_shape(const data::Scene& scene) {
  return scene.body && scene.body->radius_m > 0.0;
}

/// One tracking run: the state its steps share.
class Tracking {
 public:
  Tracking(const fs::path& video, const data::Scene& scene,
           const std::optional<data::Camera>& camera, const TrackOptions& options)
      : video_(video),
        scene_(scene),
        options_(options),
        objects_(std::max(options.objects, scene.tracking.objects)),
        recording_(video, source_options(scene, options)),
        camera_(resolve_camera(scene, camera, recording_.info())) {
    if (objects_ < 1) throw InputError("the number of objects must be at least 1");
    choose_finder();
  }

  TrackResult run() {
    background_ = Background::from_samples(recording_.samples());
    explained_.resize(recording_.held().size());
    for (int object = 0; object < objects_; ++object)
      if (!follow_next_body(object)) break;
    if (paths_.empty() && background_.camera_moves())
      throw InputError(
          fmt::format("{}: no moving body found: the camera moves, nearly all of the picture "
                      "changes: put it on a stand, or track a "
                      "part where it is still with --from and --to",
                      video_.string()));
    if (paths_.empty())
      throw InputError(
          fmt::format("{}: no moving body found; point at it: track --at x,y, or at_px under "
                      "[tracking] in the scene",
                      video_.string()));
    follow_the_rest();
    return result();
  }

 private:
  static SourceOptions source_options(const data::Scene& scene, const TrackOptions& options) {
    SourceOptions source;
    source.chroma = true;
    source.frame_rate_hz = scene.camera.frame_rate_hz;
    source.from = options.from.empty() ? scene.tracking.from : options.from;
    source.to = options.to.empty() ? scene.tracking.to : options.to;
    return source;
  }

  void choose_finder() {
    if (has_shape(scene_) && camera_) {
      finder_ = make_cylinder_finder(*scene_.body, scene_.support, *camera_, exposure_fraction(),
                                     options_.effort);
      return;
    }
    finder_ = make_rim_finder(false);
  }

  [[nodiscard]] double exposure_fraction() const {
    if (scene_.camera.exposure_s)
      return *scene_.camera.exposure_s * recording_.info().frame_rate_hz;
    return camera_ && camera_->exposure_fraction ? *camera_->exposure_fraction : 0.0;
  }

  /// Whether what was followed ever moved, or turned: a reflection or a clamp that trembles with
  /// its stand does not.
  static bool moves(const BodyPath& path) {
    constexpr double kTrembles_px = 0.7, kOfItsSize = 0.12, kTurns_rad = 0.3;
    std::vector<double> x, y, turned;
    for (const auto& [index, at] : path.frames) {
      x.push_back(at.seen.centre_px.x());
      y.push_back(at.seen.centre_px.y());
      if (at.seen.turned_rad) turned.push_back(*at.seen.turned_rad);
    }
    // From the fifth to the ninety-fifth of a hundred: single slips do not count.
    const auto spread = [](std::vector<double>& values) {
      if (values.empty()) return 0.0;
      std::sort(values.begin(), values.end());
      return values[values.size() * 95 / 100] - values[values.size() * 5 / 100];
    };
    const double still_px = std::max(kTrembles_px, kOfItsSize * usual_radius_px(path));
    return std::hypot(spread(x), spread(y)) > still_px || spread(turned) > kTurns_rad ||
           path.frames.begin()->second.seen.pose;
  }

  /// Finds one more body in the held frames and follows it both ways. False if there is none.
  /// @param attempts how many more times to look when what was found does not move.
  static constexpr int kAttempts = 4;
  bool follow_next_body(int object, int attempts = kAttempts) {
    const auto& held = recording_.held();
    std::optional<Seed> seed;
    if (object == 0 && scene_.tracking.at_px) {
      seed = find_seed_at(held, background_, *finder_, *scene_.tracking.at_px);
      if (!seed)
        throw InputError(
            fmt::format("{}: no rim found around the point given with --at", video_.string()));
    } else {
      if (attempts < kAttempts) seed = find_seed_turning(held, background_, *finder_);
      if (!seed || attempts < kAttempts - 1)
        seed = find_seed(held, background_, *finder_, explained_);
    }
    if (!seed) return false;
    BodyPath path;
    if (!seed->seen.pose) path.marks = marks_of(held[seed->held_index], seed->seen);
    if (path.marks) seed->seen.turned_rad = 0.0, seed->seen.turned_sigma_rad = 0.01;
    path.frames[held[seed->held_index].index] = {held[seed->held_index].t_s, seed->seen};
    auto follower = std::make_unique<Follower>(*finder_, background_, path.marks);
    BodyPath::Frames before;
    auto backward = std::async(std::launch::async, [&] {
      Follower back(*finder_, background_, path.marks);
      back.start(held[seed->held_index], seed->seen);
      for (std::size_t i = seed->held_index; i-- > 0;)
        if (auto seen = back.follow(held[i], explained_[i]))
          before[held[i].index] = {held[i].t_s, trimmed(std::move(*seen))};
    });
    follower->start(held[seed->held_index], seed->seen);
    for (std::size_t i = seed->held_index + 1; i < held.size(); ++i)
      if (auto seen = follower->follow(held[i], explained_[i]))
        path.frames[held[i].index] = {held[i].t_s, trimmed(std::move(*seen))};
    backward.get();
    path.frames.merge(before);
    if (seed->seen.pose) decide(path, held, *follower);
    explain(path);
    const bool pointed_at = object == 0 && scene_.tracking.at_px;
    if (!pointed_at && !moves(path)) return attempts > 0 && follow_next_body(object, attempts - 1);
    paths_.push_back(std::move(path));
    followers_.push_back(std::move(follower));
    return true;
  }

  /// What consecutive frames say together: attitudes, and frames their neighbours can help.
  void decide(BodyPath& path, const std::vector<Frame>& frames, Follower& ahead) const {
    std::vector<Glimpse> glimpses;
    for (const Frame& frame : frames) {
      glimpses.push_back({&frame, {}});
      if (const auto at = path.frames.find(frame.index); at != path.frames.end())
        glimpses.back().seen = std::move(at->second.seen);
    }
    decide_attitudes(background_, *finder_, glimpses);
    mend_from_neighbours(background_, *finder_, glimpses);
    for (Glimpse& g : glimpses) {
      path.frames.erase(g.frame->index);
      if (g.seen) path.frames[g.frame->index] = {g.frame->t_s, trimmed(std::move(*g.seen))};
    }
    // Enough for the forecast to learn how the body moves.
    constexpr int kLast = 6;
    std::vector<std::pair<double, Sighting>> last;
    auto at = path.frames.end();
    for (int k = 0; k < kLast && at != path.frames.begin(); ++k) --at;
    for (; at != path.frames.end(); ++at) last.emplace_back(at->second.t_s, at->second.seen);
    ahead.resume(last);
  }

  [[nodiscard]] std::shared_ptr<const SpinProfile> marks_of(const Frame& frame,
                                                            const Sighting& seen) const {
    auto profile = SpinProfile::from_face(frame.luma, seen.rim, background_.plate().noise_levels);
    return profile ? std::make_shared<const SpinProfile>(std::move(*profile)) : nullptr;
  }

  /// Edge points are kept only when they are wanted: they would outweigh everything else.
  [[nodiscard]] Sighting trimmed(Sighting seen) const {
    if (!options_.edges) seen.edges = {};
    return seen;
  }

  void explain(const BodyPath& path) {
    const auto& held = recording_.held();
    for (std::size_t i = 0; i < held.size(); ++i)
      if (const auto at = path.frames.find(held[i].index); at != path.frames.end())
        explained_[i].emplace_back(at->second.seen.centre_px, at->second.seen.rim.semi_major_px());
  }

  /// Streams what follows the held frames past all followers.
  void follow_the_rest() {
    frames_ = static_cast<std::int64_t>(recording_.held().size());
    for (const Frame& frame : recording_.held()) damaged_ += frame.damaged ? 1 : 0;
    recording_.release();
    report_progress();
    std::vector<Frame> window;
    std::size_t bytes = 0;
    while (auto frame = recording_.next()) {
      Follower::Others others;
      for (std::size_t k = 0; k < followers_.size(); ++k) {
        auto seen = followers_[k]->follow(*frame, others);
        if (!seen) continue;
        others.emplace_back(seen->centre_px, seen->rim.semi_major_px());
        paths_[k].frames[frame->index] = {frame->t_s, trimmed(std::move(*seen))};
      }
      ++frames_;
      damaged_ += frame->damaged ? 1 : 0;
      if (frames_ % 16 == 0) report_progress();
      bytes += frame->luma.total() + 2 * frame->chroma.total();
      window.push_back(std::move(*frame));
      // Large pictures: windows that are mostly overlap would decide the same frames repeatedly.
      if (bytes < Recording::kHeldBytes / 2 || window.size() < 3 * kOverlap) continue;
      settle(window);
      bytes = bytes / window.size() * kOverlap;
      window.erase(window.begin(), window.end() - kOverlap);
    }
    settle(window);
    report_progress();
  }

  /// The last frames of a window open the next.
  static constexpr std::ptrdiff_t kOverlap = 12;
  void settle(const std::vector<Frame>& window) {
    if (window.size() <= kOverlap) return;
    for (std::size_t k = 0; k < followers_.size(); ++k)
      if (!paths_[k].frames.empty() && paths_[k].frames.begin()->second.seen.pose)
        decide(paths_[k], window, *followers_[k]);
  }

  void report_progress() const {
    if (options_.progress) options_.progress(frames_, recording_.info().frames);
  }

  /// Metres for a track measured by rims: a camera over the floor, or the known radius.
  [[nodiscard]] MetreRule metre_rule(const BodyPath& path, std::string& words) const {
    const VideoInfo& video = recording_.info();
    MetreRule rule;
    if (camera_) {
      rule.camera = camera_;
      words = "rim centre projected to the floor by the camera";
    } else if (has_shape(scene_)) {
      const double scale = usual_radius_px(path) / scene_.body->radius_m;
      rule.camera = data::Camera::from_scale(video.width_px, video.height_px, scale);
      words = fmt::format("scale {:.6g} px/m from the known radius", scale);
    } else {
      words = "none: pixels only";
    }
    return rule;
  }

  TrackResult result() {
    TrackResult result;
    result.file.source = video_.filename().string();
    result.file.angles_folded = has_shape(scene_) && camera_ && scene_.body->faces_look_alike();
    result.summary.frames = frames_;
    result.summary.damaged = damaged_;
    std::string words = "camera and known body: the CoM of the fitted cylinder";
    AssemblyOptions how{.fold = result.file.angles_folded,
                        .readout_s = scene_.camera.readout_s,
                        .height_px = recording_.info().height_px};
    if (scene_.body && !scene_.body->marks.empty())
      how.mark_rad = scene_.body->marks.front().angle_rad;
    for (std::size_t k = 0; k < paths_.size(); ++k) {
      const BodyPath& path = paths_[k];
      MetreRule rule;
      if (!(has_shape(scene_) && camera_)) rule = metre_rule(path, words);
      result.file.tracks.push_back(assemble_track(path, static_cast<int>(k), rule, how));
      const auto& samples = result.file.tracks.back().samples;
      const auto found = static_cast<std::int64_t>(samples.size());
      result.summary.found += found;
      result.summary.lost += frames_ - found;
      result.summary.doubtful += std::count_if(samples.begin(), samples.end(),
                                               [](const auto& s) { return s.quality < 0.5; });
    }
    result.file.camera = words;
    result.summary.camera_words = words;
    if (options_.edges) write_edges(*options_.edges);
    return result;
  }

  void write_edges(const fs::path& target) const {
    data::Table table;
    table.header = {{"edges", "accepted edge points per frame"}};
    table.columns = {"frame",    "object",   "x_px",     "y_px",
                     "normal_x", "normal_y", "sigma_px", "residual_px"};
    std::vector<double> cells;
    for (std::size_t k = 0; k < paths_.size(); ++k)
      for (const auto& [index, at] : paths_[k].frames)
        for (const EdgePoint& e : at.seen.edges)
          cells.insert(cells.end(), {static_cast<double>(index), static_cast<double>(k),
                                     e.image_px.x(), e.image_px.y(), e.normal_px.x(),
                                     e.normal_px.y(), e.sigma_px, e.residual_px});
    const auto columns = static_cast<Eigen::Index>(table.columns.size());
    const auto rows = static_cast<Eigen::Index>(cells.size()) / columns;
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    table.values = Eigen::Map<const RowMajor>(cells.data(), rows, columns);
    data::write_table(table, target);
  }

  fs::path video_;
  const data::Scene& scene_;
  const TrackOptions& options_;
  int objects_;
  Recording recording_;
  std::optional<data::Camera> camera_;
  std::unique_ptr<BodyFinder> finder_;
  Background background_;
  std::vector<Follower::Others> explained_;  ///< per held frame
  std::vector<BodyPath> paths_;
  std::vector<std::unique_ptr<Follower>> followers_;
  std::int64_t frames_ = 0, damaged_ = 0;
};

}  // namespace

TrackResult track_video(const fs::path& video, const data::Scene& scene,
                        const std::optional<data::Camera>& camera, const TrackOptions& options) {
  Tracking tracking(video, scene, camera, options);
  TrackResult result = tracking.run();
  result.file.source_sha256 = data::sha256_of_file(video);
  return result;
}

}  // namespace trochoid::tracking
