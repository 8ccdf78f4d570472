#pragma once
#include <string>
#include <vector>

#include "trochoid/data/body.hpp"
#include "trochoid/data/camera.hpp"
#include "trochoid/data/table.hpp"
#include "trochoid/data/track.hpp"

/// What a track is worth against truth (rendered recordings) or hand-made labels (real ones).
namespace trochoid::tools {

/// Against exact truth. NaN where nothing can be compared.
struct TruthScore {
  int frames = 0;           ///< of the truth in which at least half of the outline is visible
  int found = 0, lost = 0;  ///< of these
  int wrong = 0;            ///< samples farther off than the body is large
  double rms_px = 0.0, largest_px = 0.0, rms_mm = 0.0;
  Eigen::Vector2d bias_px = Eigen::Vector2d::Zero(), bias_mm = Eigen::Vector2d::Zero();
  double normalised = 0.0;  ///< mean of error^T covariance^-1 error / 2; 1 = honest sigmas
  /// Where the tilt is 15..75 deg; folded if the faces look alike.
  struct Angle {
    double rms_deg = 0.0;     ///< modulo whole turns
    double normalised = 0.0;  ///< mean of (error / sigma)^2; 1 = honest sigmas
  } tilt, precession, spin;
  std::int64_t worst_frame = -1;
};
/// @param truth columns frame, x_m, y_m, x_px, y_px, theta_rad, phi_rad, psi_rad, vis_frac.
/// @param size_px about the radius of the body: what counts as the wrong object.
[[nodiscard]] TruthScore score_against_truth(const data::Track& track, const data::Table& truth,
                                             const data::Body& body, double size_px);

/// Against labels with their own uncertainty.
struct LabelScore {
  std::string label;
  int object = -1;  ///< the track that fits the labels best
  int frames = 0, found = 0;
  Eigen::Vector2d rms = Eigen::Vector2d::Zero();  ///< error / uncertainty_px per axis
  Eigen::Vector2d bias_px = Eigen::Vector2d::Zero();
  std::int64_t worst_frame = -1;
  int angles = 0;                 ///< labelled angles compared
  double angle_offset_deg = 0.0;  ///< mean difference: where the zero of the spin lies
  double angle_rms_deg = 0.0;     ///< about that offset
};
/// Labels below `first_frame` are left out.
[[nodiscard]] LabelScore score_against_labels(const data::TrackFile& file,
                                              const data::Table& labels, const std::string& name,
                                              std::int64_t first_frame = 0);

/// Pixels a metre of the floor takes at the table's origin, mean square of both directions.
[[nodiscard]] double px_per_m(const data::Camera& camera);

}  // namespace trochoid::tools
