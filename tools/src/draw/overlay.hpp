#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "draw/overlay_content.hpp"
#include "trochoid/tracking/frame_source.hpp"

namespace trochoid::tools {

struct OverlayOptions {
  std::string from, to;  ///< seconds ("1.5") or frames ("f120"); empty = all
  /// Play this many times slower than it happened; 0 = just enough that no more than 60 pictures a
  /// second are shown, which is what screens show.
  double slow = 0.0;
  /// Called before every picture; may be empty. What it throws ends the work, nothing is written.
  std::function<void()> between_pictures{};
};

/// What an overlay video holds: picture k of the video is frame[k] of the recording, at t_s[k]. A
/// frame stays as long as it did in the recording: it comes again where the next was lost or late,
/// for two seconds of the overlay at most.
struct OverlayFrames {
  double frame_rate_hz = 0.0;  ///< of the overlay video
  double slowed = 1.0;
  int width_px = 0, height_px = 0;
  std::vector<std::int64_t> frame;
  std::vector<double> t_s;
};

/// Refuses to draw into a recording what was tracked in another: it would lie beside the bodies.
/// @param track  what the user knows the track by.  @throws InputError if the track tells the
/// checksum of its recording and this is not it.
void check_recording(const OverlayInput& input, const std::string& track);

/// Before the work. @throws InputError unless the name ends in .mp4.
void check_overlay_name(const std::filesystem::path& path);

/// Opens the recording that is drawn into, in colour. Pictures that carry no times have those of
/// the track; seconds of `options` are the track's, too, where it numbers its frames.
std::unique_ptr<tracking::FrameSource> open_recording(const OverlayInput& input,
                                                      const OverlayOptions& options);

/// Writes the recording with observed points and their fading trail, the predicted path and body,
/// scale bar, time, residual strip, and a mark on frames without a detection. H.264 in mp4, whole
/// or not at all.
/// @throws InputError for an unreadable recording, or if no encoder is at hand.
OverlayFrames write_overlay(const OverlayInput& input, const OverlayOptions& options,
                            const std::filesystem::path& path);

/// Writes one picture (PNG or JPEG by the name) of the whole path on the first tracked frame, cut
/// to what moved and enlarged, with scale bar and residual figures.
void write_still(const OverlayInput& input, const OverlayOptions& options,
                 const std::filesystem::path& path);

/// Writes the residuals of the whole track as one picture. Without a fit nothing is written.
void write_residual_picture(const OverlayInput& input, const std::filesystem::path& path);

}  // namespace trochoid::tools
