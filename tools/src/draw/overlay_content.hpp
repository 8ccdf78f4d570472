#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "common/prediction.hpp"
#include "draw/frame_times.hpp"
#include "trochoid/data/camera.hpp"
#include "trochoid/data/fit.hpp"
#include "trochoid/data/outline.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/data/track.hpp"

namespace trochoid::tools {

/// What an overlay is made of.
struct OverlayInput {
  std::filesystem::path video;
  data::TrackFile tracks;
  std::optional<data::Fit> fit;
  std::optional<data::Scene> scene;    ///< without it, the scene stored in the fit
  std::optional<data::Camera> camera;  ///< overrides the scene's
  int fit_track = 0;                   ///< which of the fit's tracks this is
};

struct ObservedPoint {
  std::int64_t frame;
  double t_s;
  Eigen::Vector2d px;
};

/// A fitted arc in the image.
struct PredictedLine {
  std::vector<double> t_s;
  std::vector<Eigen::Vector2d> px;
};

struct ObjectPaths {
  int object = 0;
  std::vector<ObservedPoint> observed;
  double usual_step_s = 0.0;  ///< between points; 0 if there is one only
  std::vector<PredictedLine> predicted;
  std::vector<Residual> residuals;  ///< empty without a fit
};

/// Track and prediction brought into the pixels of the recording; nothing is drawn here.
class OverlayContent {
 public:
  /// @param width_px, height_px of the upright recording.
  /// @throws InputError if the track has neither pixels nor a camera to make them.
  OverlayContent(const OverlayInput& input, int width_px, int height_px);
  /// @throws InputError if the camera is for pictures of another size than the recording's.
  void check_pictures(int width_px, int height_px, const std::string& recording) const;

  [[nodiscard]] const std::vector<ObjectPaths>& objects() const { return objects_; }
  [[nodiscard]] const PredictedPath& prediction() const { return prediction_; }
  [[nodiscard]] bool has_prediction() const { return !prediction_.arcs.empty(); }
  /// Pixels per metre on a level plane at the middle of the path; nothing without a scale.
  [[nodiscard]] std::optional<double> scale_px_per_m() const { return scale_px_per_m_; }
  /// Time of a frame: the track's own, between and beyond its samples continued at its frame rate.
  /// `fallback_s` is returned for a track without frame numbers.
  [[nodiscard]] double time_of_frame(std::int64_t frame, double fallback_s) const;
  /// As FrameTimes has it.
  [[nodiscard]] double usual_step_s() const { return frame_times_.usual_step_s(); }
  /// The object's point in the frame; of points without frame numbers the nearest, within half a
  /// usual step, so that gaps stay gaps. Null if there is none.
  [[nodiscard]] const ObservedPoint* observed_in(const ObjectPaths& paths, std::int64_t frame,
                                                 double t_s) const;
  /// Whether any object was found in the frame.
  [[nodiscard]] bool detected(std::int64_t frame, double t_s) const;
  [[nodiscard]] double first_s() const { return first_s_; }
  [[nodiscard]] double last_s() const { return last_s_; }

  /// The body's edges at a time: as predicted, or (without a fit) as tracked. Empty when the body's
  /// shape, its attitude or the camera is unknown.
  [[nodiscard]] std::vector<data::WireCurve> wireframe_at(int object, std::int64_t frame,
                                                          double t_s) const;
  /// Image of the predicted centre of mass; nothing outside the fitted arcs.
  [[nodiscard]] std::optional<Eigen::Vector2d> predicted_px(int object, double t_s) const;

 private:
  void collect(const data::Track& track);
  void collect_times();
  [[nodiscard]] std::optional<data::Pose<>> tracked_pose(int object, std::int64_t frame) const;

  data::TrackFile tracks_;
  std::optional<data::Scene> scene_;
  std::optional<data::Camera> camera_;
  PredictedPath prediction_;
  std::vector<ObjectPaths> objects_;
  FrameTimes frame_times_;
  std::optional<double> scale_px_per_m_;
  double first_s_ = 0.0, last_s_ = 0.0;
};

/// The straight-down view that carries the track's metres into its pixels (least squares over
/// scale, turn and shift); nothing if the track lacks either or does not move.
[[nodiscard]] std::optional<data::Camera> camera_from_track(const data::TrackFile& tracks,
                                                            int width_px, int height_px);

}  // namespace trochoid::tools
