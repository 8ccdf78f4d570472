#pragma once
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "trochoid/data/track.hpp"

namespace trochoid::tools {

/// When a track has its frames: between samples evenly, before and after them at its usual rate.
class FrameTimes {
 public:
  explicit FrameTimes(const data::TrackFile& tracks);
  /// Nothing of a track without two numbered frames, here and below [s].
  [[nodiscard]] std::optional<double> time_of(std::int64_t frame) const;
  /// The inverse, between frames a fraction.
  [[nodiscard]] std::optional<double> frame_at(double t_s) const;
  [[nodiscard]] bool numbered() const { return !known_.empty(); }
  /// From frame to frame where none is lost and the camera is as fast as it is for a quarter of the
  /// recording; 0 if not known [s].
  [[nodiscard]] double usual_step_s() const { return usual_s_; }
  /// Whether the frame has a sample.
  [[nodiscard]] bool has(std::int64_t frame) const;

 private:
  std::vector<std::pair<std::int64_t, double>> known_;  ///< in order
  double frame_s_ = 0.0, usual_s_ = 0.0;
};

}  // namespace trochoid::tools
