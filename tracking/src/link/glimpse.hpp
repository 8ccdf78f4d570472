#pragma once
#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "edges/shading_prior.hpp"
#include "find/background.hpp"
#include "find/body_finder.hpp"
#include "trochoid/tracking/frame_source.hpp"

namespace trochoid::tracking {

/// One body in one of consecutive frames; nothing where it was not seen.
struct Glimpse {
  const Frame* frame = nullptr;
  std::optional<Sighting> seen{};
  /// Log odds of its attitude to the mirror image, by all frames together; 0: not known.
  double attitude_log_odds = 0.0;

  [[nodiscard]] bool posed() const { return seen && seen->pose; }
  [[nodiscard]] const data::Pose<>& pose() const { return seen->pose->pose; }
};

/// Logarithm of how many times higher one fit to a picture scores than another: > 0 for the first,
/// symmetric about 0; the larger, the likelier. PoseMeasurement::score_px of its edges, and its
/// shadow where both cover about the same of the picture.
[[nodiscard]] double log_score_ratio(const Sighting& one, const Sighting& other);
/// The same of its shadow alone.
[[nodiscard]] double shadow_log_score_ratio(const Sighting& one, const Sighting& other);

/// Where a body was one frame earlier (side 1) or will be one later (-1): how far it smears, and
/// which way it goes.
struct Beside {
  data::Pose<> pose;
  int side;
};

/// Measures a body about a guess in one frame.
class Measuring {
 public:
  Measuring(const Background& background, const BodyFinder& finder)
      : background_(background), finder_(finder) {}

  /// @param near its pose one frame off, if known.
  /// @param shading light beside its outline in other frames, if known.
  /// @param there it is right there: nothing farther off is looked for.
  [[nodiscard]] std::optional<Sighting> operator()(const Frame& frame, Sighting guess,
                                                   const std::optional<Beside>& near,
                                                   const ShadingMemory* shading = nullptr,
                                                   bool there = false);

  /// The floor around the body in some pose, where it is seen about `seen`.
  [[nodiscard]] std::optional<FloorDarkening> floor_around(const Frame& frame, const Sighting& seen,
                                                           const data::Pose<>& pose);
  /// How well its shadow agrees with that; 0 without a lamp.
  [[nodiscard]] double shadow(const Frame& frame, const Sighting& seen, const data::Pose<>& pose);

 private:
  /// Brings the background around a sighting to the brightness of the frame; false if that is out
  /// of the picture.
  bool prepare_plate(const Frame& frame, const Sighting& seen, double beside);
  /// Under the lamp, which is known.
  [[nodiscard]] double agreement(const std::optional<FloorDarkening>& floor) const;

  const Background& background_;
  const BodyFinder& finder_;
  Plate plate_;
};

/// Runs work(measuring, i) for i of 0..count on all processors, each next one where one is free.
/// What it gives must not depend on the order.
void on_all_cores(const Background& background, const BodyFinder& finder, std::size_t count,
                  const std::function<void(Measuring&, std::size_t)>& work);

/// What the frames around frame i show of the picture: the light beside the outline, and how sharp
/// it is.
struct Surroundings {
  ShadingMemory shading;
  double blur_px;
};
[[nodiscard]] Surroundings surroundings_of(const std::vector<Glimpse>& glimpses, std::size_t i);

/// Allows for the centre being this far off as well, in the picture and on the floor.
void allow_for(const Eigen::Vector2d& off_px, const Eigen::Vector2d& off_m, Sighting& seen);
/// Doubts a sighting's attitude: allows for its centre and tilt being this far off as well, and
/// takes nothing for known of its azimuth.
void doubt_attitude(const Eigen::Vector2d& off_px, const Eigen::Vector2d& off_m,
                    double off_tilt_rad, Sighting& seen);
/// Angle between two axes [rad]; with faces that look alike between the lines they lie on.
[[nodiscard]] double between_axes(const Eigen::Vector3d& a, const Eigen::Vector3d& b, bool alike);
/// Difference of two tilts [rad]; with faces that look alike of whichever face is up.
[[nodiscard]] double between_tilts(double one_rad, double other_rad, bool alike);

}  // namespace trochoid::tracking
