#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "trochoid/data/fit.hpp"
#include "trochoid/data/pose.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/data/track.hpp"

namespace trochoid::tools {

/// The fitted model's motion over one arc, on a grid that holds every sample of the track and is
/// several times finer in between.
struct PredictedArc {
  int object = 0;
  double from_s = 0.0, to_s = 0.0;
  std::string ended;  ///< why the prediction stops before to_s, empty if it does not
  std::vector<double> t_s;
  std::vector<data::Pose<>> pose;
  bool has_tilt = false;  ///< pose.theta_rad and phi_rad are predicted; else they are 0
  /// Of the track's sigmas; 1 unless the fit converged: what does not explain a track must not look
  /// as if it did for the sigmas it would need.
  double noise_scale = 1.0;
};

struct PredictedPath {
  std::string model;
  std::vector<PredictedArc> arcs;
  /// Pose at a time within an arc of the object; nothing outside.
  [[nodiscard]] std::optional<data::Pose<>> at(int object, double t_s) const;
  [[nodiscard]] const PredictedArc* arc_at(int object, double t_s) const;
  /// A disc on a fixed pivot: where it is was given, not predicted.
  [[nodiscard]] bool angles_alone() const { return model == "pivot"; }
};

/// The track of a file that an arc of a fit was made from; null: of another recording.
/// @param arc  place in Fit::arcs
/// @param first_track  which of the fitted tracks is the file's first
[[nodiscard]] const data::Track* track_of_arc(const data::Fit& fit, std::size_t arc,
                                              const data::TrackFile& file, int first_track);

/// Replays a fit: rebuilds its model from the scene stored in it and runs it with the fitted
/// values.
/// @param track_index which of the fitted tracks (fits of several recordings); @throws InputError
/// if the fit holds no arc of that track.
[[nodiscard]] PredictedPath replay(const data::Fit& fit, const data::TrackFile& tracks,
                                   int track_index = 0);

/// x and y of the fit's first arc on these tracks [m], integrated with the given tolerance: what
/// error against run time is measured with. Nothing if the run ends early.
[[nodiscard]] std::optional<Eigen::VectorXd> replay_first_arc(const data::Fit& fit,
                                                              const data::TrackFile& tracks,
                                                              int track_index, double tolerance);

/// Observed minus predicted spin angle of a sample, the nearer way round; nothing where one of them
/// is not known.
[[nodiscard]] std::optional<double> spin_residual_rad(const data::TrackSample& sample, int object,
                                                      const PredictedPath& path);

/// Observed minus predicted position of one sample.
struct Residual {
  std::int64_t frame = -1;
  double t_s = 0.0;
  Eigen::Vector2d value_m;
  Eigen::Vector2d sigma_m;  ///< of the track times the arc's noise scale; NaN when unknown
  double noise_scale;       ///< that scale
};
/// One list per track of the file, in its order.
[[nodiscard]] std::vector<std::vector<Residual>> residuals(const data::TrackFile& tracks,
                                                           const PredictedPath& path);
/// Root mean square of the residuals per axis [m]; NaN for an empty list.
[[nodiscard]] double rms_m(const std::vector<Residual>& residuals);

}  // namespace trochoid::tools
