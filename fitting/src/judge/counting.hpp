#pragma once
#include <vector>

#include "problem/problem.hpp"

// How single samples stand to a prediction.
namespace trochoid::fitting {

/// Residuals of an arc whitened by the track's own sigmas, none weighed down; empty where the model
/// has no prediction.
[[nodiscard]] Eigen::VectorXd plain_residuals(const Problem& problem, int arc,
                                              const Eigen::VectorXd& u);

/// Positions as predicted, given those.
[[nodiscard]] Eigen::MatrixX2d predicted_m(const ArcData& data, const Eigen::VectorXd& residuals);

/// How much a position counts in a fit.
struct Counting {
  double t_s = 0.0, weight = 1.0;
  bool glitch = false;  ///< lies on no path with the others: as a rule the tracker's error
};

/// That of an arc's positions, in the order of their times.
[[nodiscard]] std::vector<Counting> counting(const Problem& problem, int arc,
                                             const Eigen::VectorXd& u);

/// Whether all sigmas are a tracker's or unknown: stated ones without pixels are somebody's word
/// for independent errors.
[[nodiscard]] bool is_tracked(const Problem& problem);
/// By how much chi-square may fall for each further parameter because a tracker errs with the
/// motion, times its noise: rendered recordings of rolling rings and discs came to 7.
inline constexpr double kOfATracker = 20.0;

}  // namespace trochoid::fitting
