#pragma once
#include <Eigen/Core>
#include <span>
#include <vector>

namespace trochoid::fitting {

/// A curve smoothed by sliding least-squares cubics, with its derivatives.
struct SmoothCurve {
  Eigen::MatrixXd value, first, second;  ///< samples x columns; derivatives per s, per s^2
  int half_width = 0;                    ///< samples to each side of a window
};

/// Sliding local cubic over 2 half_width + 1 samples (fewer at the ends, where the window is
/// shifted inwards). Times need not be uniform but must increase. At most 4 columns, at least 4
/// samples.
[[nodiscard]] SmoothCurve smooth(std::span<const double> t_s, const Eigen::MatrixXd& samples,
                                 int half_width);

/// The widest of a ladder of windows whose residual is still compatible with the noise.
[[nodiscard]] SmoothCurve smooth_auto(std::span<const double> t_s, const Eigen::MatrixXd& samples);

/// Standard deviation of one coordinate about a locally cubic curve of seven samples; robust to a
/// few outliers, never zero.
[[nodiscard]] double noise_about_smooth_curve(std::span<const double> t_s,
                                              const Eigen::MatrixXd& samples);

/// Samples of which fewer do not tell white noise from motion.
inline constexpr int kFewestForNoise = 20;

/// Standard deviation of one coordinate's white noise, from divided differences of order 6 and 8,
/// the smaller: fast motion (eight samples to a turn) adds nothing to them, noise that hangs
/// together over several samples little. Robust to a few outliers; infinite for fewer than
/// kFewestForNoise samples.
[[nodiscard]] double white_noise(std::span<const double> t_s, const Eigen::MatrixXd& samples);

/// Median; 0 for an empty list.
[[nodiscard]] double median_or_zero(std::vector<double> values);

}  // namespace trochoid::fitting
