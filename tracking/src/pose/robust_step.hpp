#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "trochoid/data/pose_motion.hpp"
#include "trochoid/tracking/outline_fit.hpp"

namespace trochoid::tracking {

inline constexpr int kGroups = 4;  ///< outer silhouette, bore, the body's own edges, colour

/// One measured edge for the linear fit: observed offset along the normal and how it depends on the
/// pose. Two nuisances are common to the whole outline: `swell` multiplies an error of the size (+1
/// on outer rims, -1 on bores), `polarity` a shift towards the brighter side (the sign of the
/// contrast).
struct EdgeEquation {
  data::PoseMotion::Step motion;
  double swell = 1.0, polarity = 1.0;
  /// Contrast over mean level: how far the edge moves if the transfer curve is not the one assumed.
  double tone = 0.0;
  /// Taken off the offset for the shadow beside the body; by what share too much or too little of
  /// it, is a nuisance common to the outline [px].
  double shadow_px = 0.0;
  /// What the edge model may be wrong by [px], alike for neighbours in direction within a group.
  double model_px = 0.0;
  int group = 0;               ///< 0 .. kGroups - 1
  double direction_rad = 0.0;  ///< of the normal
  Eigen::Vector2d normal = Eigen::Vector2d::UnitX();
  Eigen::Vector2d from_centre_px = Eigen::Vector2d::Zero();  ///< where it is; for find_uncertainty
  /// What it may be wrong by together with all others of its group: alike for the whole lit side of
  /// a body, opposite on the dark one, so that only the answer moves and no residual shows it [px].
  double common_px = 0.0;
  /// The same, for all edges of the far face and the wall against those of the near face [px].
  double lower_px = 0.0;
  /// The same, where the outline is narrow against where it is wide; signed [px].
  double flank_px = 0.0;
  /// The same, where the outline turns from wide to narrow against where it turns back; signed
  /// [px].
  double twist_px = 0.0;
  /// Seen in the colour planes: with a shift of these planes and one along the normal as nuisances.
  bool colour = false;
  double offset_px = 0.0;
  double variance_px2 = 1.0;
  double arc_px = 1.0;
  int curve = 0;             ///< equations of one curve follow each other along it
  double weight = 0.0;       ///< out: 0..1, how much the fit trusts it
  double residual_px = 0.0;  ///< out
};

struct RobustSolution {
  data::PoseMotion::Step step;
  double scale = 1.0;  ///< of the errors, over what the edges claim; at least 1
  double swell_px = 0.0, polarity_px = 0.0;
  Eigen::Vector2d colour_shift_px = Eigen::Vector2d::Zero();
  double rms_px = 0.0;
  // From here on by find_uncertainty.
  Eigen::MatrixXd covariance;  ///< of the step, errors correlated along the outline allowed for
  Eigen::MatrixXd common;      ///< of it, what errors common to whole sides of the outline do
  /// PoseMeasurement's; empty unless asked for.
  decltype(PoseMeasurement::sheared) sheared{};
  /// Variance the rest has been multiplied by: how far the answer moves without parts of the
  /// outline, over what was expected. Noisy; frames of one clip have nearly the same.
  double inflation = 1.0;
  /// Shift of what the colour planes show as edges alone tell it, either coordinate by itself, and
  /// the inverse of its variance [px^-2]; 0 where they do not tell.
  Eigen::Array2d colour_off_px = Eigen::Array2d::Zero();
  Eigen::Array2d colour_information = Eigen::Array2d::Zero();
};

/// Tukey-weighted least squares of offset = motion . step + nuisances, with weak priors:
/// `prior_sd` per parameter. False if fewer than 8 equations, or if none of them counts.
/// @param directions allow for what the edge models may be wrong by in every direction.
bool solve_robustly(std::vector<EdgeEquation>& equations, const data::PoseMotion::Step& prior_sd,
                    double least_scale_px, bool directions, RobustSolution& out);

/// How well a solution found with `directions` is known; infinitely badly if its equations do not
/// determine it. The equations are as solve_robustly left them.
/// @param rows_in_turn  whether to find RobustSolution::sheared as well.
void find_uncertainty(const std::vector<EdgeEquation>& equations,
                      const data::PoseMotion::Step& prior_sd, bool rows_in_turn,
                      RobustSolution& solution);

}  // namespace trochoid::tracking
