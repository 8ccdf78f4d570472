#pragma once
#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include "trochoid/data/track.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::fitting {

/// What was measured; each channel has its own noise scale.
enum class Channel { position, theta, phi, psi };
inline constexpr int kChannels = 4;
/// Residual rows of one measurement: x and y of a position, or an angle.
[[nodiscard]] constexpr int rows_of(Channel channel) {
  return channel == Channel::position ? 2 : 1;
}

/// One measurement.
struct Reading {
  int sample = 0;
  Channel channel = Channel::position;
  Eigen::Vector2d value = Eigen::Vector2d::Zero();  ///< [m], or [rad] in the first entry
  Eigen::Matrix2d whitener =
      Eigen::Matrix2d::Identity();  ///< W W^T = inverse covariance; r = W^T d
  int row = 0;                      ///< first residual row
};

/// What one likely deviation of the camera shifts each sample by: x, y [m], tilt, precession times
/// its sine, spin [rad].
using CameraShifts = Eigen::Matrix<double, Eigen::Dynamic, 5>;

/// The measurements of one arc, ready for residuals.
struct ArcData {
  int track = 0;
  int object = 0;
  std::vector<double> t_s;
  std::vector<double> row_px;  ///< where in the image each sample was; NaN: unknown
  double start_s = 0.0;        ///< the initial state of the arc belongs to this instant
  std::vector<model::Observable> observables;
  std::vector<Reading> readings;
  int rows = 0;
  bool folded = false;  ///< faces look alike: theta measured as min(theta, pi - theta)
  /// Tilt and precession are compared each by itself: from afar every turn leads downhill.
  bool angles_apart = false;
  bool filmed = false;  ///< has pixel positions: measured in images, with their common errors
  std::vector<CameraShifts> camera_shifts;  ///< of the deviations that matter (camera_error.hpp)
  bool held = false;           ///< samples before these were left out: the body was held or pushed
  bool sigma_unknown = false;  ///< no position came with covariance; whitener is a first guess
  /// By which the noise differs from what the whiteners state, for each channel.
  std::array<double, kChannels> noise_scale{1.0, 1.0, 1.0, 1.0};

  [[nodiscard]] int observable_index(model::Observable observable) const;  ///< -1 if absent
  [[nodiscard]] double duration_s() const { return t_s.empty() ? 0.0 : t_s.back() - t_s.front(); }
  /// Positions as n x 2 [m]; every sample must have one.
  [[nodiscard]] Eigen::MatrixX2d positions_m() const;
  /// The same arc with the samples first, first + step, ... below last only.
  [[nodiscard]] ArcData slice(int first, int last, int step = 1) const;
  /// The same arc with these samples (ascending) only.
  [[nodiscard]] ArcData keep(const std::vector<int>& samples) const;
  /// The same arc without the readings of one channel.
  [[nodiscard]] ArcData without(Channel channel) const;
};

[[nodiscard]] inline double noise_scale(const ArcData& arc, Channel channel) {
  return arc.noise_scale[static_cast<std::size_t>(channel)];
}
/// That of positions, or where an arc has none of the spin angle.
[[nodiscard]] inline double main_noise_scale(const ArcData& arc) {
  const bool positions = arc.observables[0] == model::Observable::x_m;
  return noise_scale(arc, positions ? Channel::position : Channel::psi);
}

/// Which measurements a model can use.
struct ChannelChoice {
  bool position = true, theta = false, phi = false, psi = false;
};

/// Reads samples [first, last) of a track. Samples without metres are left out when positions are
/// wanted. Positions without covariance are as uncertain as the median of those with one; where
/// none has one, as a guess from the scatter about a smooth curve.
/// @throws TrackError naming the sample and the column for an error of nothing and for a place
/// farther than 10 km away.
[[nodiscard]] ArcData make_arc(const data::Track& track, int first, int last,
                               const ChannelChoice& choice, bool folded);

/// One tracker measured a recording: of its arcs without covariance all are guessed to be as noisy
/// as the longest tells.
void share_guessed_noise(std::span<ArcData> arcs);

/// The samples on a path that one body can have taken (consistent_path) and whose angles lie where
/// their neighbours on both sides let expect them: a tilt taken for its mirror image, or another
/// body's outline, stands out by far. All of them if two fifths or more would go.
[[nodiscard]] std::vector<int> consistent_samples(const ArcData& arc);

/// How far an arc's positions reach along x or y, whichever is more [m]; 0 without any. What lies
/// far outside and on no path with the others (consistent_samples) is left out of it, unless that
/// is a tenth of the samples or more.
[[nodiscard]] double extent_m(const ArcData& arc);

/// By as much a tracker may misjudge its noise: where samples do not tell noise from motion, their
/// scatter about a smooth curve is believed up to so many times the stated sigmas.
inline constexpr double kMisjudged = 2.0;

/// Factor, at least 1, by which a channel's readings scatter more about a smooth curve than their
/// own sigmas say; at most kMisjudged where they are fewer than kFewestForNoise.
[[nodiscard]] double excess_scatter(const ArcData& arc, Channel channel);

/// Whether a reading and the next one are the tilt and the precession of one sample, to be compared
/// as the direction of the axis that they are.
[[nodiscard]] bool shows_direction(const ArcData& arc, std::size_t reading);

/// One over the errors of such a direction along its meridian and its parallel [1/rad]. Where the
/// tilt may be nothing the parallel is taken to be no shorter than that of the tilt's error.
[[nodiscard]] Eigen::Vector2d weights_of_direction(const Reading& tilt, const Reading& precession);

/// Whitened differences prediction - measurement and their derivatives. Tilt and precession of one
/// sample are compared as the direction they are (direction.hpp): the flatter a body lies, the less
/// its precession means, and at rest on its face it has none.
/// @param values as Prediction::values for arc.t_s and arc.observables.
/// @param jacobian as Prediction::jacobian, or empty; whitened rows are written to `out_jacobian`.
void whiten(const ArcData& arc, const Eigen::VectorXd& values, const Eigen::MatrixXd& jacobian,
            Eigen::VectorXd& out, Eigen::MatrixXd* out_jacobian);

}  // namespace trochoid::fitting
