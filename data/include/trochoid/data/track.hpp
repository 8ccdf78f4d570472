#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace trochoid::data {

/// A measured angle with its standard deviation [rad], which a fit wants larger than 0.
struct MeasuredAngle {
  double value_rad = 0.0;
  double sigma_rad = 0.0;
  friend bool operator==(const MeasuredAngle&, const MeasuredAngle&) = default;
};

/// One frame's measurement of one body.
struct TrackSample {
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  std::int64_t frame = -1;  ///< 0-based as decoded; -1 if the file has none
  double t_s = 0.0;         ///< presentation time (of the sample's own row with a rolling shutter)
  Eigen::Vector2d centre_m{kUnknown, kUnknown};  ///< CoM, table frame; NaN when no scale is known
  /// Covariance of centre_m [m^2]; NaN when unknown (a bare t, x, y file).
  Eigen::Matrix2d covariance_m2 = Eigen::Matrix2d::Constant(kUnknown);
  Eigen::Vector2d centre_px{kUnknown,
                            kUnknown};           ///< projection of the CoM into the distorted image
  std::optional<MeasuredAngle> theta, phi, psi;  ///< tilt, precession (unwrapped), spin (unwrapped)
  double quality = TrackSample::kUnknown;        ///< 0 (doubtful) .. 1 (sure)

  [[nodiscard]] bool has_metres() const { return centre_m.allFinite(); }
  [[nodiscard]] bool has_covariance() const { return covariance_m2.allFinite(); }
  /// Half seen, or one of two mirror images: to be looked at before it is believed.
  [[nodiscard]] bool doubtful() const { return quality < 0.5; }
};

/// The path of one body: strictly increasing t_s; frames without the body have no sample.
struct Track {
  int object = 0;
  std::vector<TrackSample> samples;
};

/// A track file: its provenance and one track per body.
struct TrackFile {
  std::string source;              ///< file name of the recording, without its folder
  std::string source_sha256;       ///< hex digest of the recording, may be empty
  std::string camera;              ///< how metres were obtained, in words
  std::string made_by;             ///< program and version
  bool angles_folded = false;      ///< theta reported as min(theta, pi - theta): faces look alike
  std::vector<std::string> notes;  ///< further header lines (gaps, doubtful frames)
  std::vector<Track> tracks;       ///< at least one
};

/// @throws InputError naming `where` and the sample if times do not increase or values are not
/// finite.
void check(const Track& track, const std::string& where);

}  // namespace trochoid::data
