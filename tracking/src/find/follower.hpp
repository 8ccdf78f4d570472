#pragma once
#include <memory>
#include <optional>
#include <vector>

#include "find/background.hpp"
#include "find/body_finder.hpp"
#include "find/forecast.hpp"
#include "find/palette.hpp"
#include "find/spin_profile.hpp"

namespace trochoid::tracking {

/// Follows one body from frame to frame, in either direction of time: predicts, measures, and when
/// the prediction fails looks about with the background's help. What it cannot measure it leaves
/// out; it never answers with the prediction.
class Follower {
 public:
  /// Places other bodies are known to be in a frame (centre and radius), not to be taken for ours.
  using Others = std::vector<std::pair<Eigen::Vector2d, double>>;

  Follower(const BodyFinder& finder, const Background& background,
           std::shared_ptr<const SpinProfile> marks);

  /// What it has followed is known better now: goes on from the last sightings of these.
  /// @param seen by time, from the oldest.
  /// @param frames_s times of the frames in which that is known, the last one it has followed last:
  /// in those after the last sighting the body was not seen.
  void resume(const std::vector<std::pair<double, Sighting>>& seen,
              const std::vector<double>& frames_s);
  /// Starts from a measured sighting.
  void start(const Frame& frame, const Sighting& seen);
  /// The body in the next frame (earlier or later than the last), if it is seen there.
  [[nodiscard]] std::optional<Sighting> follow(const Frame& frame, const Others& others = {});

 private:
  [[nodiscard]] std::optional<Sighting> look_near(const Frame& frame, const Sighting& predicted,
                                                  const Others& others);
  [[nodiscard]] std::optional<Sighting> look_at(const Frame& frame, const Sighting& expected,
                                                double reach_px, Plate& plate) const;
  [[nodiscard]] std::optional<Sighting> look_about(const Frame& frame, const Sighting& predicted,
                                                   const Others& others);
  [[nodiscard]] double farthest_px(const Sighting& predicted) const;
  [[nodiscard]] std::vector<Detection> regions_about(const Frame& frame, const Sighting& predicted,
                                                     double farthest_px, const cv::Rect& box,
                                                     const Others& others) const;
  [[nodiscard]] bool seen_well(const Sighting& seen) const;
  [[nodiscard]] Sighting as_it_moves(const Frame& frame, const Sighting& found) const;
  [[nodiscard]] double relative_contrast(const Sighting& seen) const;
  [[nodiscard]] double relative_support(const Sighting& seen) const;
  [[nodiscard]] bool warrants_wider_search(const Sighting& seen) const;
  [[nodiscard]] bool plausible(const Sighting& seen, const Sighting& predicted,
                               double reach_px) const;
  void set_shape_knowledge(Look& look, Sighting& guess) const;
  void read_marks(const Frame& frame, Sighting& seen, double predicted_rad) const;
  [[nodiscard]] std::optional<Sighting> search(const Frame& frame, const Sighting& predicted,
                                               const Others& others, std::optional<Sighting> seen);
  void accept(const Frame& frame, Sighting& seen, const Sighting& predicted, double passed);
  void learn_usual(const Sighting& seen, const Sighting& predicted);

  const BodyFinder& finder_;
  const Background& background_;
  std::shared_ptr<const SpinProfile> marks_;
  Forecast forecast_;
  Plate plate_;  ///< background at the brightness of the frame, valid near the body
  std::vector<Plate> guessed_plates_;  ///< the same for guesses that are looked at side by side
  double gain_ = 1.0;
  double shape_surprise_px_ = 0.3;
  // What is usual: running means over sightings of the body in full view.
  Eigen::Matrix2d mean_shape_px_ = Eigen::Matrix2d::Zero();
  double shape_scatter_px_ = 1.0;  ///< running deviation from it
  double usual_major_px_ = 0.0;
  double usual_accepted_ = 0.0;    ///< of Sighting::accepted, 0..1
  Contrast usual_contrast_{};      ///< but for its colours, which palette_ has
  double usual_support_px_ = 0.0;  ///< of PoseMeasurement::support_px
  Palette palette_;
  double seed_score_ = 0.0;  ///< detection_score of the sighting it started from
  double last_s_ = 0.0;      ///< time of the last frame, with the body or without
  int lost_ = 0;             ///< frames since it was last seen: each is one more look in vain
  // How long, in usual_frames: that tells how far it may have gone.
  double away_ = 0.0;              ///< since it was last seen
  double off_colour_ = 0.0;        ///< in a row with what is followed in other colours
  double weak_ = 0.0;              ///< of weak support, less twice those of better
  int futile_ = 0, patience_ = 0;  ///< frames to wait before searching in spite of a sighting
};

}  // namespace trochoid::tracking
