#pragma once
#include <array>
#include <deque>
#include <optional>
#include <vector>

#include "find/body_finder.hpp"

namespace trochoid::tracking {

/// Where a body will be next, from where it was. Bodies on a table move in different manners - a
/// puck straight on, a coin round and round with its precession or rocking over its face, after an
/// impact none of these - so
/// several guesses run side by side, and the one that has missed least of late is believed. Works
/// in either direction of time.
class Forecast {
 public:
  /// @param finder outlives this; tells where a guessed pose would be seen.
  explicit Forecast(const BodyFinder& finder) : finder_(finder) {}
  /// Forgets everything and starts from one sighting.
  void start(double t_s, const Sighting& seen);
  /// Learns from the next sighting. @param lasting false: only its position is believed.
  void add(double t_s, const Sighting& seen, bool lasting);
  /// The most trusted guess.
  [[nodiscard]] Sighting at(double t_s) const;
  /// The other guesses, most trusted first, those that say the same left out.
  [[nodiscard]] std::vector<Sighting> alternatives(double t_s) const;
  /// A sighting as it would have been one frame before, had it moved as between the last two;
  /// nothing if these are not in successive frames.
  [[nodiscard]] std::optional<Sighting> one_frame_before(const Sighting& seen) const;
  /// Running size of what the trusted guess misses: of the centre, and of the rim as the axis
  /// turns [px].
  [[nodiscard]] double surprise_px() const { return missed_px_[trusted()]; }
  [[nodiscard]] const Sighting& last() const { return past_.back().seen; }
  /// 1 if that was before t_s, -1 if it was after it.
  [[nodiscard]] int side_of_last(double t_s) const { return t_s < past_.back().t_s ? -1 : 1; }
  /// Whether the body has been seen more than once: after a single sighting it is taken for still.
  [[nodiscard]] bool knows_speed() const { return past_.size() > 1; }
  /// Frames between the last sighting and t_s.
  [[nodiscard]] double frames_since(double t_s) const;

 private:
  enum Manner { kStraight, kTurning, kSwinging, kStill, kManners };
  struct Moment {
    double t_s;
    Sighting seen;
  };
  [[nodiscard]] Manner trusted() const;
  [[nodiscard]] Sighting guess(Manner manner, double t_s) const;

  const BodyFinder& finder_;
  std::deque<Moment> past_;  ///< newest last, at most three
  std::array<double, kManners> missed_px_{};
  double frame_s_ = 0.0;  ///< typical time between frames
};

/// How far two sightings are apart [px]: their centres, or their rims as the axes differ.
[[nodiscard]] double apart_px(const Sighting& a, const Sighting& b);

}  // namespace trochoid::tracking
