#include "trochoid/tracking/tracker.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

#include "find/body_search.hpp"
#include "find/camera_motion.hpp"
#include "find/open_shutter.hpp"
#include "find/recording.hpp"
#include "find/stoppable_finder.hpp"
#include "link/linking.hpp"
#include "link/path_motion.hpp"
#include "link/track_assembly.hpp"
#include "link/track_result.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/parallel.hpp"

namespace trochoid::tracking {
namespace {

namespace fs = std::filesystem;

std::optional<data::Camera> resolve_camera(const data::Scene& scene,
                                           const std::optional<data::Camera>& given,
                                           const VideoInfo& video, const fs::path& recording) {
  std::optional<data::Camera> camera =
      given ? given : data::camera_of(scene, video.width_px, video.height_px);
  if (camera) camera->check_size(video.width_px, video.height_px, recording.string());
  return camera;
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
        recording_(video, source_options(scene, options), options.held_bytes, options.checkpoint),
        camera_(resolve_camera(scene, camera, recording_.info(), video)) {
    if (camera_ && scene.camera.transfer) camera_->transfer = *scene.camera.transfer;
    if (objects_ < 1) throw InputError("the number of objects must be at least 1");
    check_readout();
    choose_finder();
  }

  TrackResult run() {
    while (read_window()) {
      settle();
      follow_bodies();
      if (!bodies_missing()) recording_.stop_sampling();
      watch_camera();
      report_progress();
    }
    if (paths_.empty()) nothing_found();
    return result();
  }

 private:
  static SourceOptions source_options(const data::Scene& scene, const TrackOptions& options) {
    SourceOptions source;
    source.chroma = true;
    source.apart_in_time = true;
    source.frame_rate_hz = scene.camera.frame_rate_hz;
    source.missing_frames = scene.camera.missing_frames;
    source.from = options.from.empty() ? scene.tracking.from : options.from;
    source.to = options.to.empty() ? scene.tracking.to : options.to;
    return source;
  }

  /// Rows read for longer than a picture lasts would put the times of a track out of order, which
  /// shows only when it is done.
  void check_readout() const {
    constexpr double kRoom = 1.01;  // the rate is an average
    const double rate_hz = recording_.info().frame_rate_hz, readout_s = this->readout_s();
    if (rate_hz > 0.0 && readout_s * rate_hz > kRoom)
      throw InputError(
          fmt::format("{}: camera.readout_s = {:g} is longer than the {:.4g} s from picture to "
                      "picture; is it in seconds?",
                      video_.string(), readout_s, 1.0 / rate_hz));
  }

  /// As the scene says, else the camera's file; 0: all rows at once.
  [[nodiscard]] double readout_s() const {
    if (scene_.camera.readout_s > 0.0 || !camera_) return scene_.camera.readout_s;
    return camera_->readout_s.value_or(0.0);
  }

  void choose_finder() {
    finder_ = has_shape(scene_) && camera_ ? cylinder_finder(exposure_fraction().value_or(0.0))
                                           : rim_finder();
  }

  [[nodiscard]] std::unique_ptr<BodyFinder> cylinder_finder(double exposure_fraction) const {
    return make_stoppable(make_cylinder_finder(*scene_.body, scene_.support, *camera_,
                                               exposure_fraction, options_.effort,
                                               readout_s() * recording_.info().frame_rate_hz *
                                                   readout_share_per_px(recording_.info())),
                          options_.checkpoint);
  }

  [[nodiscard]] std::unique_ptr<BodyFinder> rim_finder() const {
    return make_stoppable(make_rim_finder(), options_.checkpoint);
  }

  /// Nothing where neither scene nor camera say it and the pictures have not told.
  [[nodiscard]] std::optional<double> exposure_fraction() const {
    if (scene_.camera.exposure_s)
      return *scene_.camera.exposure_s * recording_.info().frame_rate_hz;
    return camera_ && camera_->exposure_fraction ? camera_->exposure_fraction : seen_exposure_;
  }

  [[nodiscard]] bool bodies_missing() const {
    return paths_.size() < static_cast<std::size_t>(objects_);
  }

  [[noreturn]] void nothing_found() {
    if (!span_.moving_to)
      tell_other_size(find_seed(recording_.window(), background_, *rim_finder(), explained_),
                      "moves", ", or point at the body: at x,y");
    if (span_.moving_to)
      throw InputError(
          fmt::format("{}: no moving body found: the camera moves, nearly all of the picture "
                      "changes: put it on a stand, or track a "
                      "part where it is still (from, to)",
                      video_.string()));
    tell_too_small();
    throw InputError(
        fmt::format("{}: no moving body found; point at it: at x,y, or at_px under "
                    "[tracking] in the scene",
                    video_.string()));
  }

  /// Of so few pixels no outline is told from noise.
  void tell_too_small() const {
    constexpr double kFew_px = 8.0;
    const VideoInfo& video = recording_.info();
    const double radius_px =
        finder_->expected_major_px({0.5 * video.width_px, 0.5 * video.height_px});
    if (radius_px > 0.0 && radius_px < kFew_px)
      throw InputError(
          fmt::format("{}: no moving body found: by radius_m and the camera or scale its rim has a "
                      "radius of about {:.1f} px, too few to be found; film it larger, 30 px at "
                      "least",
                      video_.string(), radius_px));
  }

  /// A wrong scale or radius hides a body that is plain to see: its rim alone is.
  /// @param where which body it is.  @param or_else what else may help.
  void tell_other_size(const std::optional<Seed>& by_rim, const char* where,
                       const char* or_else) const {
    constexpr double kClearly = 1.5;  // more than an oblique view makes of a right size
    if (!by_rim || !camera_ || !has_shape(scene_)) return;
    const double seen_px = by_rim->seen.rim.semi_major_px();
    const double expected_px = finder_->expected_major_px(by_rim->seen.centre_px);
    if (!(expected_px > 0.0) || std::max(seen_px / expected_px, expected_px / seen_px) < kClearly)
      return;
    throw InputError(
        fmt::format("{}: no body of the given size {}: by radius_m and the camera or scale its rim "
                    "has a radius of about {:.0f} px, and what {} one of about {:.0f} px; check "
                    "radius_m and the camera's scale{}",
                    video_.string(), where, expected_px, where, seen_px, or_else));
  }

  /// Reads on, the bodies known so far followed as the frames come. False at the end.
  bool read_window() {
    const bool more = recording_.advance(kOverlap, [this](const Frame& frame) { see(frame); });
    if (!more || !bodies_missing()) return more;
    background_ = Background::from_samples(recording_.samples());
    // Who asks for a part of a recording may do so because the camera moves in the rest.
    if (background_.camera_moves() && recording_.leave_out_the_rest())
      background_ = Background::from_samples(recording_.samples());
    if (background_.camera_moves()) span_.moving_to = recording_.window().back().index;
    explained_.assign(recording_.window().size(), {});
    for (const Ellipse& rim : in_plate_) background_.clear_of(rim);
    for (const BodyPath& path : paths_) explain(path);
    return true;
  }

  /// Bodies that are not followed yet, as long as the window shows any.
  void follow_bodies() {
    while (bodies_missing() && follow_next_body()) {
    }
    if (exposure_sought_ || exposure_fraction() || !first_path_is_posed()) return;
    exposure_sought_ = true;
    seen_exposure_ = find_exposure_fraction(
        [this](double fraction) { return cylinder_finder(fraction); }, background_, moving_looks());
    if (seen_exposure_) follow_anew();
  }

  [[nodiscard]] bool first_path_is_posed() const {
    return !paths_.empty() && !paths_.front().frames.empty() &&
           paths_.front().frames.begin()->second.seen.pose;
  }

  /// Of the first body: frames of the window in which it is well seen, as in the frame before.
  [[nodiscard]] std::vector<MovingLook> moving_looks() const {
    constexpr double kWell = 0.3;
    const auto& frames = paths_.front().frames;
    const auto well_seen = [&](std::int64_t index) -> const Sighting* {
      const auto at = frames.find(index);
      return at != frames.end() && at->second.seen.pose && at->second.seen.accepted > kWell
                 ? &at->second.seen
                 : nullptr;
    };
    std::vector<MovingLook> looks;
    for (const Frame& frame : recording_.window()) {
      const Sighting *seen = well_seen(frame.index), *before = well_seen(frame.index - 1);
      if (seen != nullptr && before != nullptr) looks.push_back({&frame, seen, before});
    }
    return looks;
  }

  /// Follows the bodies of the window once more, each from where it is seen best, knowing how long
  /// the shutter is open; as they were if one is then seen in clearly fewer frames.
  void follow_anew() {
    constexpr double kFewer = 0.95;
    auto finder = std::exchange(finder_, cylinder_finder(*seen_exposure_));
    auto paths = std::exchange(paths_, {});
    auto followers = std::exchange(followers_, {});
    explained_.assign(recording_.window().size(), {});
    for (const BodyPath& path : paths) {
      Followed found = follow_from(best_seen(path));
      if (static_cast<double>(found.path.frames.size()) <
          kFewer * static_cast<double>(path.frames.size())) {
        paths_ = std::move(paths);
        followers_ = std::move(followers);  // which refer to that finder
        finder_ = std::move(finder);
        seen_exposure_.reset();
        return;
      }
      explain(found.path);
      add(std::move(found));
    }
  }

  /// @param path of the window, with a pose.
  [[nodiscard]] Seed best_seen(const BodyPath& path) const {
    Seed seed;
    double best_px = -1.0;
    const auto& window = recording_.window();
    for (std::size_t i = 0; i < window.size(); ++i) {
      const auto at = path.frames.find(window[i].index);
      if (at == path.frames.end() || !at->second.seen.pose) continue;
      const double support_px = at->second.seen.visible_support_px();
      if (support_px > best_px) best_px = support_px, seed = {i, at->second.seen};
    }
    return seed;
  }

  /// Where the bodies are in a frame, with their size.
  [[nodiscard]] Follower::Others bodies_in(const Frame& frame) const {
    Follower::Others bodies;
    for (const BodyPath& path : paths_)
      if (const auto at = path.frames.find(frame.index); at != path.frames.end())
        bodies.emplace_back(at->second.seen.centre_px, at->second.seen.rim.semi_major_px());
    return bodies;
  }

  /// The camera's own motion, in the frames of the window, once it is known where the bodies are.
  void watch_camera() {
    if (paths_.empty()) return;
    const Plate& plate = background_.plate();
    if (!camera_motion_) camera_motion_.emplace(plate.luma, plate.noise_levels);
    for (const Frame& frame : recording_.window()) camera_motion_->look(frame, bodies_in(frame));
  }

  void see(const Frame& frame) {
    Follower::Others others;
    for (std::size_t k = 0; k < followers_.size(); ++k) {
      auto seen = followers_[k]->follow(frame, others);
      if (!seen) continue;
      others.emplace_back(seen->centre_px, seen->rim.semi_major_px());
      paths_[k].frames[frame.index] = {frame.t_s, trimmed(std::move(*seen))};
    }
    if (read_.frames++ > 0)
      read_.missing += frame.missing_before;
    else
      span_.first = frame.index;
    span_.last = frame.index;
    read_.damaged += frame.damaged ? 1 : 0;
    if (read_.frames % 16 == 0) report_progress();
  }

  /// A body followed through the window, and its follower at the window's end, to go on with.
  struct Followed {
    BodyPath path;
    std::unique_ptr<Follower> follower;
  };

  /// Finds one more body in the window and follows it both ways. False if there is none.
  bool follow_next_body() {
    if (paths_.empty() && scene_.tracking.at_px) {
      Followed found = follow_from(seed_pointed_at());
      if (found.path.frames.empty()) no_rim_at_the_point();
      add(std::move(found));
      return true;
    }
    constexpr int kAttempts = 4;
    for (int attempt = 0; attempt < kAttempts; ++attempt) {
      const auto seed = find_seed(recording_.window(), background_, *finder_, explained_);
      if (!seed) return paths_.empty() && follow_one_in_plate();
      Followed found = follow_from(*seed);
      if (found.path.frames.empty()) {  // all frames together deny what one of them showed
        explained_[seed->held_index].emplace_back(seed->seen.centre_px,
                                                  seed->seen.rim.semi_major_px());
        continue;
      }
      if (attempt == 0) prefer_one_that_turns(found);
      follow_off_the_plate(found);
      explain(found.path);
      if (!moves(found.path) || is_known(found.path)) continue;
      add(std::move(found));
      return true;
    }
    return false;
  }

  /// A body followed already, found again in a frame in which it had been lost.
  [[nodiscard]] bool is_known(const BodyPath& path) const {
    constexpr double kSamePlace_radii = 0.3;
    return std::any_of(paths_.begin(), paths_.end(), [&](const BodyPath& known) {
      return std::any_of(path.frames.begin(), path.frames.end(), [&](const auto& frame) {
        const auto at = known.frames.find(frame.first);
        if (at == known.frames.end()) return false;
        const Sighting &a = frame.second.seen, &b = at->second.seen;
        return (a.centre_px - b.centre_px).norm() < kSamePlace_radii * b.rim.semi_minor_px();
      });
    });
  }

  void add(Followed found) {
    paths_.push_back(std::move(found.path));
    followers_.push_back(std::move(found.follower));
  }

  /// What looks most like a body but hardly moves may be part of the scene, and the body one that
  /// turns in place: it explains more of what changes.
  /// @param found in one frame at least, and so it stays.
  void prefer_one_that_turns(Followed& found) {
    constexpr double kHardly_radii = 0.5;
    if (found.path.frames.begin()->second.seen.pose || travel_in_radii(found.path) > kHardly_radii)
      return;
    const auto seed = find_seed_turning(recording_.window(), background_, *finder_);
    if (!seed) return;
    Followed other = follow_from(*seed);
    const auto explains = [this](const Followed& followed) {
      return moves(followed.path) ? changes_explained(followed.path, background_.active()) : 0;
    };
    if (explains(other) <= explains(found)) return;
    explain(found.path);
    found = std::move(other);
  }

  /// A body that keeps to its place is in the plate itself, and is lost in frames in which it looks
  /// as it does there. With the floor continued below it, it may be seen in more of them.
  /// @param found in one frame at least, and so it stays.
  void follow_off_the_plate(Followed& found) {
    constexpr double kInPlace_radii = 0.5, kMostSeen = 0.9;
    const auto seen_in = [](const Followed& followed) {
      return static_cast<double>(followed.path.frames.size());
    };
    const auto frames = static_cast<double>(recording_.window().size());
    if (!found.path.frames.begin()->second.seen.pose || seen_in(found) > kMostSeen * frames ||
        travel_in_radii(found.path) > kInPlace_radii)
      return;
    const Background before = background_;
    in_plate_.push_back(reach_of(found.path));
    background_.clear_of(in_plate_.back());
    if (const auto seed = find_seed(recording_.window(), background_, *finder_, explained_)) {
      Followed other = follow_from(*seed);
      if (seen_in(other) > seen_in(found)) {
        found = std::move(other);
        return;
      }
    }
    background_ = before;
    in_plate_.pop_back();
  }

  /// A body that turns in place about its own axis, with nothing but a mark that moves.
  bool follow_one_in_plate() {
    constexpr double kMost = 0.6;  // of what changes
    const auto rim = find_seed_turning(recording_.window(), background_, *rim_finder());
    if (!rim) return false;
    const Background before = background_;
    if (const auto seed = seed_in_plate(rim)) {
      Followed found = follow_from(*seed);
      const cv::Mat& active = background_.active();
      if (moves(found.path) &&
          changes_explained(found.path, active) >= kMost * cv::countNonZero(active)) {
        add(std::move(found));
        return true;
      }
    }
    // Nothing but floor was there.
    background_ = before;
    in_plate_.pop_back();
    return false;
  }

  /// A body whose outline never moves is in the plate itself. Once its rim is known, the floor is
  /// continued below it, and it is seen like any other.
  std::optional<Seed> seed_in_plate(const std::optional<Seed>& rim) {
    if (!rim) return std::nullopt;
    in_plate_.push_back(rim->seen.rim);
    background_.clear_of(rim->seen.rim);
    return find_seed_at(recording_.window(), background_, *finder_, rim->seen.centre_px);
  }

  [[nodiscard]] Seed seed_pointed_at() {
    const auto& window = recording_.window();
    const Eigen::Vector2d& at_px = *scene_.tracking.at_px;
    const VideoInfo& video = recording_.info();
    if (!(at_px.minCoeff() >= 0.0 && at_px.x() < video.width_px && at_px.y() < video.height_px))
      throw InputError(
          fmt::format("{}: the point at {:g},{:g} px is outside the picture of "
                      "{} x {} pixels",
                      video_.string(), at_px.x(), at_px.y(), video.width_px, video.height_px));
    auto seed = find_seed_at(window, background_, *finder_, at_px);
    std::optional<Seed> by_rim;
    // Of a body in its plate no edge is new.
    constexpr double kNew = 0.3;
    if (!seed)
      seed = seed_in_plate(by_rim = find_seed_at(window, background_, *rim_finder(), at_px));
    else if (!seed->seen.pose && seed->seen.contrast.outline < kNew)
      seed = seed_in_plate(seed);
    if (!seed) tell_other_size(by_rim, "is at the point", "");
    if (!seed) no_rim_at_the_point();
    return *seed;
  }

  [[noreturn]] void no_rim_at_the_point() const {
    throw InputError(fmt::format("{}: no rim found around the point at {:g},{:g} px",
                                 video_.string(), scene_.tracking.at_px->x(),
                                 scene_.tracking.at_px->y()));
  }

  /// Follows a body through the window, ahead and back at once.
  /// @return without any frame where these deny together what each of them showed.
  [[nodiscard]] Followed follow_from(Seed seed) const {
    BodyPath path;
    if (!paths_.empty()) path.chroma_site_px = paths_.front().chroma_site_px;
    const auto& window = recording_.window();
    const Frame& start = window[seed.held_index];
    if (!seed.seen.pose) path.marks = marks_of(start, seed.seen);
    if (path.marks) seed.seen.turned_rad = 0.0, seed.seen.turned_sigma_rad = 0.01;
    path.frames[start.index] = {start.t_s, seed.seen};
    const auto follow = [&](Follower& follower, std::ptrdiff_t step, BodyPath::Frames& frames) {
      follower.start(start, seed.seen);
      const auto end = static_cast<std::ptrdiff_t>(window.size());
      for (auto i = static_cast<std::ptrdiff_t>(seed.held_index) + step; i >= 0 && i < end;
           i += step) {
        const auto k = static_cast<std::size_t>(i);
        if (auto seen = follower.follow(window[k], explained_[k]))
          frames[window[k].index] = {window[k].t_s, trimmed(std::move(*seen))};
      }
    };
    BodyPath::Frames before;
    Follower back(*finder_, background_, path.marks);
    auto ahead = std::make_unique<Follower>(*finder_, background_, path.marks);
    data::in_parallel(2, 2, [&](std::size_t side) {
      if (side == 0)
        follow(*ahead, 1, path.frames);
      else
        follow(back, -1, before);
    });
    path.frames.merge(before);
    if (seed.seen.pose) decide(path, window, 0, *ahead);
    return {std::move(path), std::move(ahead)};
  }

  /// What consecutive frames say together. At the front of a window, where they tell of frames on
  /// one side only, what was settled before stands; behind that they begin anew.
  /// @param settled see Linking.
  void decide(BodyPath& path, const std::vector<Frame>& frames, std::size_t settled,
              Follower& ahead) const {
    std::vector<Glimpse> glimpses;
    std::vector<std::optional<Sighting>> settled_before;
    const auto undoubted_before = std::exchange(path.undoubted, {});
    for (const Frame& frame : frames) {
      Glimpse& g = glimpses.emplace_back(Glimpse{&frame, {}});
      if (const auto at = path.frames.find(frame.index); at != path.frames.end())
        g.seen = std::move(at->second.seen);
      if (settled_before.size() < settled)
        settled_before.push_back(g.seen);
      else if (const auto at = undoubted_before.find(frame.index); at != undoubted_before.end())
        g.seen = at->second;
    }
    // Where there are other bodies, what is dark beside one need not be its shadow.
    const Linking link{background_, *finder_, objects_ == 1, options_.effort};
    auto undoubted = link(settled, path, glimpses);
    for (std::size_t i = 0; i < settled_before.size(); ++i)
      if (settled_before[i]) glimpses[i].seen = std::move(settled_before[i]);
    for (std::size_t i = 0; i < glimpses.size(); ++i) {
      Glimpse& g = glimpses[i];
      path.frames.erase(g.frame->index);
      const bool begins_next_window = i + kOverlap >= glimpses.size();
      if (undoubted[i] && begins_next_window)
        path.undoubted[g.frame->index] = trimmed(std::move(*undoubted[i]));
      if (!g.seen) continue;
      if (g.seen->pose && !begins_next_window) g.seen->pose->shading.reset();
      path.frames[g.frame->index] = {g.frame->t_s, trimmed(std::move(*g.seen))};
    }
    go_on(path, frames, ahead);
  }

  /// Lets a follower know what the window's frames have decided on.
  static void go_on(const BodyPath& path, const std::vector<Frame>& frames, Follower& ahead) {
    constexpr int kLast = 6;  // enough for the forecast to learn how the body moves
    std::vector<std::pair<double, Sighting>> last;
    auto at = path.frames.end();
    for (int k = 0; k < kLast && at != path.frames.begin(); ++k) --at;
    for (; at != path.frames.end(); ++at) last.emplace_back(at->second.t_s, at->second.seen);
    std::vector<double> frames_s;
    for (const Frame& frame : frames) frames_s.push_back(frame.t_s);
    ahead.resume(last, frames_s);
  }

  [[nodiscard]] std::shared_ptr<const SpinProfile> marks_of(const Frame& frame,
                                                            const Sighting& seen) const {
    auto profile = SpinProfile::from_face(frame.luma, seen.rim, background_.plate().noise_levels);
    return profile ? std::make_shared<const SpinProfile>(std::move(*profile)) : nullptr;
  }

  /// Edge points are kept only when they are wanted: they would outweigh everything else.
  [[nodiscard]] Sighting trimmed(Sighting seen) const {
    if (!options_.edges) seen.edges = std::vector<EdgePoint>();  // {} would keep their room
    return seen;
  }

  void explain(const BodyPath& path) {
    const auto& window = recording_.window();
    for (std::size_t i = 0; i < window.size(); ++i)
      if (const auto at = path.frames.find(window[i].index); at != path.frames.end())
        explained_[i].emplace_back(at->second.seen.centre_px, at->second.seen.rim.semi_major_px());
  }

  /// Attitudes of the bodies that were followed through the window.
  void settle() {
    const auto& window = recording_.window();
    if (window.size() <= kOverlap) return;
    for (std::size_t k = 0; k < followers_.size(); ++k)
      if (!paths_[k].frames.empty() && paths_[k].frames.begin()->second.seen.pose)
        decide(paths_[k], window, kOverlap / 2, *followers_[k]);
  }

  void report_progress() const {
    if (!options_.progress) return;
    // How many frames lie between two moments is not known beforehand.
    options_.progress(read_.frames, recording_.is_part() ? 0 : recording_.info().frames);
  }

  TrackResult result() {
    read_.repeated = recording_.repeated();
    read_.exposure_fraction = exposure_fraction().value_or(0.0);
    FollowedRecording followed{.video = video_,
                               .scene = scene_,
                               .camera = camera_,
                               .readout_s = readout_s(),
                               .recording = recording_,
                               .background = background_,
                               .read = read_,
                               .span = span_,
                               .seen_exposure = seen_exposure_};
    if (camera_motion_) followed.shifts = camera_motion_->shifts();
    return make_tracks(followed, paths_, options_);
  }

  fs::path video_;
  const data::Scene& scene_;
  const TrackOptions& options_;
  int objects_;
  Recording recording_;
  std::optional<data::Camera> camera_;
  std::unique_ptr<BodyFinder> finder_;
  Background background_;
  std::vector<Ellipse> in_plate_;  ///< rims of bodies that never move off the plate
  bool exposure_sought_ = false;
  std::optional<double> seen_exposure_;      ///< over the frame interval, by how edges are smeared
  std::vector<Follower::Others> explained_;  ///< per frame of the window
  std::vector<BodyPath> paths_;
  std::vector<std::unique_ptr<Follower>> followers_;
  std::optional<CameraMotion> camera_motion_;
  FramesRead span_;
  WhatWasRead read_;
  /// The last frames of a window open the next.
  static constexpr std::size_t kOverlap = 12;
};

}  // namespace

TrackResult track_video(const fs::path& video, const data::Scene& scene,
                        const std::optional<data::Camera>& camera, const TrackOptions& options) {
  Tracking tracking(video, scene, camera, options);
  TrackResult result = tracking.run();
  result.file.source_sha256 = sha256_of_recording(video);
  return result;
}

}  // namespace trochoid::tracking
