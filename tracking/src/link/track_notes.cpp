#include "link/track_notes.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "trochoid/data/path_step.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {
namespace {

using Note = std::optional<std::string>;

Note note_on_missing(const VideoInfo& video, const WhatWasRead& read) {
  if (read.missing == 0) return std::nullopt;
  return fmt::format("by their {} {} of {} pictures are missing; the others keep their times",
                     video.missing > 0 ? "numbers" : "time stamps", read.missing,
                     read.frames + read.missing);
}

Note note_on_left_out(const VideoInfo& video) {
  const auto& others = video.left_out;
  if (others.empty()) return std::nullopt;
  const bool one = others.size() == 1;
  return fmt::format("{} picture{} of the folder, named unlike the others, {} left out: {}{}",
                     others.size(), one ? "" : "s", one ? "is" : "are",
                     others.front().filename().string(), one ? "" : ", ...");
}

Note note_on_repeated(const WhatWasRead& read) {
  constexpr std::int64_t kChance = 2;
  if (read.repeated <= kChance) return std::nullopt;
  return fmt::format(
      "{} of {} pictures repeat the one before: unless the body was out of sight in them, their "
      "time stamps are wrong; was the clip converted from another rate, or did the camera "
      "stutter?",
      read.repeated, read.frames);
}

Note note_on_damaged(const WhatWasRead& read) {
  if (read.damaged == 0) return std::nullopt;
  return fmt::format(
      "{} of {} pictures {} damaged: what was decoded need not be what the camera saw",
      read.damaged, read.frames, read.damaged == 1 ? "is" : "are");
}

Note note_on_evened(const VideoInfo& video) {
  if (!video.evened || video.played_rate_hz) return std::nullopt;
  return "the time stamps are uneven, and the rate given takes the pictures for evenly spaced; "
         "without it they keep their own times";
}

Note note_on_capture(const VideoInfo& video) {
  if (!video.played_rate_hz) return std::nullopt;
  return fmt::format(
      "times are those of filming: the file says it was filmed at {0:.6g} pictures a second, and "
      "plays at {1:.6g}; with a rate of {1:.6g} (--rate, [camera] frame_rate_hz) they are those "
      "of playing it",
      *video.capture_rate_hz, *video.played_rate_hz);
}

Note note_on_exposure(const WhatWasRead& read) {
  if (read.exposure_fraction <= 1.0) return std::nullopt;
  return fmt::format(
      "exposure_s is {:.3g} times the time from picture to picture; is it in seconds?",
      read.exposure_fraction);
}

Note note_on_interlaced(const VideoInfo& video) {
  if (!video.interlaced) return std::nullopt;
  return "the video is interlaced: every picture is two half ones of different times; "
         "deinterlace it first";
}

/// Frames in a row without a sample, and the samples on both sides of them.
struct Gap {
  std::int64_t from = 0, to = 0;
  const Sighting *before = nullptr, *after = nullptr;

  [[nodiscard]] std::int64_t frames() const { return to - from + 1; }
};

std::vector<Gap> gaps_in(const BodyPath& path, const FramesRead& read) {
  std::vector<Gap> gaps;
  Gap gap{.from = read.first};
  for (const auto& [index, at] : path.frames) {
    gap.to = index - 1, gap.after = &at.seen;
    if (gap.frames() > 0) gaps.push_back(gap);
    gap = {.from = index + 1, .before = &at.seen};
  }
  gap.to = read.last;
  if (gap.frames() > 0) gaps.push_back(gap);
  return gaps;
}

bool is_cut_off(const Sighting* seen, double radius_px, const VideoInfo& video) {
  if (seen == nullptr) return false;
  const Eigen::Vector2d &at = seen->centre_px, size{video.width_px, video.height_px};
  return at.minCoeff() < radius_px || (size - at).minCoeff() < radius_px;
}

std::string why_lost(const Gap& gap, const FramesRead& read, double radius_px,
                     const VideoInfo& video) {
  if (read.moving_to && gap.from <= *read.moving_to)
    return "the camera moves there, and nearly all of the picture changes: put it on a stand";
  if (is_cut_off(gap.before, radius_px, video) || is_cut_off(gap.after, radius_px, video))
    return "it is beside the picture's edge there";
  return "no outline of its own stands out there: it is covered, smeared, or like the background";
}

}  // namespace

std::vector<std::string> notes_about_recording(const VideoInfo& video, const WhatWasRead& read) {
  std::vector<std::string> notes;
  for (const Note& note :
       {note_on_missing(video, read), note_on_left_out(video), note_on_repeated(read),
        note_on_damaged(read), note_on_evened(video), note_on_capture(video),
        note_on_exposure(read), note_on_interlaced(video)})
    if (note) notes.push_back(*note);
  return notes;
}

std::optional<std::string> note_about_pixel_aspect(const VideoInfo& video) {
  constexpr double kNoticeable = 0.01;
  if (std::abs(std::log(video.pixel_aspect)) < kNoticeable) return std::nullopt;
  return fmt::format(
      "by what the file says its pixels are {:.4g} times as wide as high, and without a camera "
      "file they are taken for square: lengths and tilts are wrong by as much; make them square "
      "first (ffmpeg -i VIDEO -vf \"scale=2*round(iw*sar/2):ih,setsar=1\" -crf 12 SQUARE.mp4), or "
      "calibrate the camera by pictures of a board",
      video.pixel_aspect);
}

namespace {

struct Range {
  double least = 0.0, most = 0.0;
  void add(double value) {
    least = std::min(least, value);
    most = std::max(most, value);
  }
  [[nodiscard]] double width() const { return most - least; }
};

// Both, unless one is small beside the other.
std::string how_it_warps(double growth, double turn_rad) {
  constexpr double kSmall = 0.3;
  std::string words;
  if (growth > kSmall * turn_rad)
    words = fmt::format("changes by {:.2g} % in size", 100.0 * growth);
  if (turn_rad > kSmall * growth)
    words +=
        fmt::format("{}turns by {:.2g} deg", words.empty() ? "" : " and ", data::degrees(turn_rad));
  return words;
}

}  // namespace

std::optional<std::string> note_about_camera_motion(
    const std::map<std::int64_t, PictureShift>& shifts, std::int64_t frames, bool metres) {
  if (shifts.empty()) return std::nullopt;
  double squares = 0.0, farthest_px = 0.0;
  Range growth, turn_rad;
  for (const auto& [index, shift] : shifts) {
    squares += shift.px.squaredNorm();
    farthest_px = std::max(farthest_px, shift.px.norm());
    growth.add(std::abs(shift.factor) - 1.0);
    turn_rad.add(std::arg(shift.factor));
  }
  const Eigen::Vector2d gone_px = shifts.rbegin()->second.px - shifts.begin()->second.px;
  const std::string moves = fmt::format(
      "by {:.2g} px rms, at most {:.2g} px, and {:.2g} px from the beginning to the end",
      std::sqrt(squares / static_cast<double>(shifts.size())), farthest_px, gone_px.norm());
  const bool warps = growth.width() > 0.0 || turn_rad.width() > 0.0;
  const bool grows = growth.width() > turn_rad.width();
  std::string words = "the camera moves: the picture of the floor " + moves;
  if (warps)
    words = fmt::format("{}: the picture of the floor {}, and its middle moves {}",
                        grows ? "the camera focuses or zooms" : "the camera turns",
                        how_it_warps(growth.width(), turn_rad.width()), moves);
  words += fmt::format(
      "; {}; {}",
      metres
          ? "metres and precession are those of a camera that stands still, as a whole known no "
            "better than to some tenths of that; pixels and tilts are left as they are, tilts with "
            "error bars for a camera that has leaned"
          : "pixels are left as they are",
      grows ? "lock focus and zoom" : "fasten the camera");
  constexpr double kNearlyAll = 0.9;
  if (const auto told = static_cast<std::int64_t>(shifts.size());
      static_cast<double>(told) < kNearlyAll * static_cast<double>(frames))
    words += fmt::format("; in {} of {} frames the floor does not tell", frames - told, frames);
  return words;
}

std::optional<std::string> note_about_edges(const std::vector<BodyPath>& paths,
                                            const data::Camera& camera) {
  constexpr double kNoticeable_px = 0.15;
  std::vector<double> polarities_px;
  for (const BodyPath& path : paths)
    for (const auto& [index, at] : path.frames)
      if (at.seen.pose) polarities_px.push_back(at.seen.pose->polarity_px);
  if (polarities_px.empty()) return std::nullopt;
  const double usual_px = data::median(std::move(polarities_px));
  if (std::abs(usual_px) < kNoticeable_px) return std::nullopt;
  const bool linear = camera.transfer == data::Transfer::linear;
  return fmt::format(
      "edges lie {:.2f} px towards the {} side; a rounded or raised rim, another radius or a "
      "camera with transfer = \"{}\" does that",
      std::abs(usual_px), usual_px > 0.0 ? "brighter" : "darker", linear ? "sRGB" : "linear");
}

namespace {

struct TimedPath {
  std::vector<double> t_s;
  Eigen::MatrixX2d at_px;
};

TimedPath path_of(const data::Track& track) {
  TimedPath path{.t_s = {}, .at_px = Eigen::MatrixX2d(std::ssize(track.samples), 2)};
  for (const data::TrackSample& sample : track.samples) {
    path.at_px.row(std::ssize(path.t_s)) = sample.centre_px;
    path.t_s.push_back(sample.t_s);
  }
  return path;
}

std::vector<data::PathStep> steps_of_path(const TimedPath& path) {
  constexpr double kClear = 0.05, kLeast_px = 0.1;
  return data::clear_path_steps(path.t_s, path.at_px, kClear, kLeast_px);
}

}  // namespace

std::optional<std::string> note_about_steps(const data::Track& track,
                                            const std::vector<std::int64_t>& known) {
  const auto& samples = track.samples;
  const TimedPath path = path_of(track);
  const std::vector<data::PathStep> steps = steps_of_path(path);
  if (steps.empty()) return std::nullopt;
  std::vector<std::int64_t> missing = known;
  bool all_missing = true;
  for (const data::PathStep& step : steps) {
    all_missing = all_missing && step.frames > 0.0;
    missing.insert(missing.end(), static_cast<std::size_t>(std::round(std::abs(step.frames))),
                   samples[static_cast<std::size_t>(step.sample)].frame);
  }
  std::string note = fmt::format(
      "the body goes on by whole frames at once ({}), as where a recorder dropped pictures, or "
      "wrote some twice, and its times do not show it",
      data::words_of(steps, path.t_s));
  std::sort(missing.begin(), missing.end());
  if (all_missing)
    note += fmt::format("; [camera] missing_frames = [{}] puts the times right",
                        fmt::join(missing, ", "));
  return note;
}

std::optional<std::string> note_about_cuts(const data::Track& track, double radius_px) {
  constexpr std::size_t kBeside = 5;
  constexpr std::int64_t kFewFrames = 15;
  constexpr double kRadii = 1.0, kTimesAsFast = 2.0;
  const auto& samples = track.samples;
  const auto way_px = [&](std::size_t i) {  // up to sample i
    return (samples[i].centre_px - samples[i - 1].centre_px).norm();
  };
  // Pictures that are missing by the file's own word have their time, and no number.
  const auto time_s = [&](std::size_t i) { return samples[i].t_s - samples[i - 1].t_s; };
  std::vector<std::size_t> cuts;
  for (std::size_t i = kBeside + 1; i + kBeside < samples.size(); ++i) {
    if (samples[i].frame - samples[i - 1].frame > kFewFrames || way_px(i) < kRadii * radius_px)
      continue;
    double fastest_px_s = 0.0;
    for (std::size_t k = 1; k <= kBeside; ++k)
      for (const std::size_t beside : {i - k, i + k})
        fastest_px_s = std::max(fastest_px_s, way_px(beside) / time_s(beside));
    if (way_px(i) > kTimesAsFast * fastest_px_s * time_s(i)) cuts.push_back(i);
  }
  // Where it goes on along its way, pictures were dropped, and that is told.
  if (!cuts.empty())
    for (const data::PathStep& step : steps_of_path(path_of(track)))
      std::erase(cuts, static_cast<std::size_t>(step.sample));
  if (cuts.empty()) return std::nullopt;
  std::vector<std::int64_t> frames;
  for (const std::size_t i : cuts) frames.push_back(samples[i].frame);
  return fmt::format(
      "the body is somewhere else at once from frame {} on: where the film is cut, or the body is "
      "thrown again, no motion leads from one part to the next; track each by itself (from, to), "
      "unless its shadow or another thing is followed in one of them",
      fmt::join(frames, ", from "));
}

std::optional<std::string> note_about_lost(const BodyPath& path, const FramesRead& read,
                                           const VideoInfo& video) {
  constexpr double kMuch = 0.1;
  const std::int64_t frames = read.last - read.first + 1;
  std::vector<Gap> gaps = gaps_in(path, read);
  std::erase_if(gaps, [&](const Gap& gap) {
    return static_cast<double>(gap.frames()) < kMuch * static_cast<double>(frames);
  });
  if (gaps.empty()) return std::nullopt;
  std::vector<std::string> where;
  for (const Gap& gap : gaps) where.push_back(fmt::format("{} to {}", gap.from, gap.to));
  const Gap& longest = *std::max_element(
      gaps.begin(), gaps.end(), [](const Gap& a, const Gap& b) { return a.frames() < b.frames(); });
  return fmt::format(
      "not seen in frames {} (of {} to {}): {}; if it is to be seen there, point at it: at x,y, "
      "from a frame in which it is",
      fmt::join(where, ", "), read.first, read.last,
      why_lost(longest, read, usual_radius_px(path), video));
}

std::string note_about_seen_exposure(double fraction, double frame_rate_hz) {
  return fmt::format(
      "how long the shutter was open is not given: by how edges in motion are smeared about {:.2g} "
      "ms, "
      "{:.0f} % of the time from picture to picture, which is allowed for; exposure_s under "
      "[camera] replaces it",
      1e3 * fraction / frame_rate_hz, 100.0 * fraction);
}

double usual_accepted(const BodyPath& path) {
  std::vector<double> accepted;
  for (const auto& [index, at] : path.frames) accepted.push_back(at.seen.accepted);
  return accepted.empty() ? 0.0 : data::median(std::move(accepted));
}

std::string note_about_likely_border(double seen, double border) {
  return fmt::format(
      "in the usual frame {:.0f} % of the outline are seen where they should be, and with a border "
      "on the faces from about {:.2f} of the radius outwards the pictures are explained better: if "
      "there is one (a raised rim, print), give border_radius_m under [body]; it may have been "
      "taken for the outline, and the error bars do not hold that",
      100.0 * seen, border);
}

data::Table edge_table(const std::vector<BodyPath>& paths) {
  data::Table table;
  table.header = {{"edges", "accepted edge points per frame"}};
  table.columns = {"frame",    "object",   "x_px",     "y_px",
                   "normal_x", "normal_y", "sigma_px", "residual_px"};
  std::vector<double> cells;
  for (std::size_t k = 0; k < paths.size(); ++k)
    for (const auto& [index, at] : paths[k].frames)
      for (const EdgePoint& e : at.seen.edges)
        cells.insert(cells.end(),
                     {static_cast<double>(index), static_cast<double>(k), e.image_px.x(),
                      e.image_px.y(), e.normal_px.x(), e.normal_px.y(), e.sigma_px, e.residual_px});
  table.set_rows(cells);
  return table;
}

}  // namespace trochoid::tracking
