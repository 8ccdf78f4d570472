#pragma once
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "find/background.hpp"
#include "find/repeats.hpp"
#include "trochoid/tracking/frame_source.hpp"

namespace trochoid::tracking {

/// A recording as the tracker reads it: a window that moves over it once, whose frames are held in
/// memory so that bodies can be sought there in any order and followed backwards. How much is held
/// does not depend on the recording's length.
class Recording {
 public:
  /// Opens the recording; its window is empty until the first advance().
  /// @param held_bytes pictures in a window, but never fewer than twice Background::kSamples.
  /// @param checkpoint called, if given, with every picture that is read; what it throws is thrown
  /// on.
  /// @throws InputError as open_video does.
  Recording(const std::filesystem::path& path, const SourceOptions& options, std::size_t held_bytes,
            std::function<void()> checkpoint = {});

  [[nodiscard]] const VideoInfo& info() const { return source_->info(); }
  /// Whether SourceOptions::from or to leave some of it out.
  [[nodiscard]] bool is_part() const { return !options_.from.empty() || !options_.to.empty(); }
  /// Pictures so far that repeat the one before.
  [[nodiscard]] std::int64_t repeated() const { return repeats_.count(); }
  [[nodiscard]] const std::vector<Frame>& window() const { return window_; }
  /// Lets all but the last `keep` frames of the window go and reads on until it is full again.
  /// `each`, if given, sees every new frame as it comes.
  /// @return false if nothing followed: the window is then as it was.
  /// @throws InputError as FrameSource::next does.
  bool advance(std::size_t keep, const std::function<void(const Frame&)>& each = {});
  /// Pictures for the background: from the window and, where that is not all, from the windows
  /// before it and the frames of the file that decode alone. The latter also where they lie outside
  /// of SourceOptions::from and to: a camera on a stand sees the same floor there, and the body may
  /// have gone.
  [[nodiscard]] BackgroundSamples samples();
  /// From now on no picture outside of SourceOptions::from and to is a sample: the camera stands
  /// still between them only. Fewer places are then seen without the body.
  /// @return false if none was.
  bool leave_out_the_rest();
  /// No samples will be asked for any more: what was kept for them goes.
  void stop_sampling();

 private:
  void remember_window();
  void read_ahead();
  [[nodiscard]] std::optional<Frame> next_of(FrameSource& source) const;

  std::filesystem::path path_;
  SourceOptions options_;
  std::size_t held_bytes_;
  std::function<void()> checkpoint_;
  std::unique_ptr<FrameSource> source_;
  std::vector<Frame> window_;
  Repeats repeats_;
  bool ended_ = false;
  std::vector<Frame> elsewhere_;  ///< pictures of other parts of the recording
  bool looked_ahead_ = false, sampled_ = true;
  bool rest_left_out_ = false;  ///< elsewhere_ holds only what once was in the window
};

}  // namespace trochoid::tracking
