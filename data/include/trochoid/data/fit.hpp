#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace trochoid::data {

/// free: estimated; fixed: given; derived: computed from free ones and priors (with propagated
/// sigma); prior: free but carried by its prior, the recording says nothing.
enum class ParameterStatus { free, fixed, derived, prior };

/// How the search for a fit ended. unexplained: the best minimum does not follow the track to its
/// noise; not_identifiable: nothing in the track asks for the model; none: not said.
enum class FitOutcome { none, converged, no_convergence, unexplained, not_identifiable };

/// What a fit is worth. good_correlated: residuals hang together and error bars are widened for
/// that; weak: explained but parameters are not determined; doubtful: followed but residuals beyond
/// twice their noise, or what was given or shared contradicts the tracks; no_feature: nothing in
/// the track asks for the model; none: not said.
enum class FitVerdict { none, good, good_correlated, weak, doubtful, no_feature, unexplained };

/// Whether chi-square bounds a parameter on both sides, on one, or on none (flat).
enum class ProfileVerdict { none, bounded, one_sided, flat };

/// How files and tables spell the values of each of them, in their order.
constexpr auto spellings(ParameterStatus) {
  return std::to_array<std::string_view>({"free", "fixed", "derived", "prior"});
}
constexpr auto spellings(FitOutcome) {
  return std::to_array<std::string_view>(
      {"", "converged", "no_convergence", "unexplained", "not_identifiable"});
}
constexpr auto spellings(FitVerdict) {
  return std::to_array<std::string_view>(
      {"", "good", "good_correlated", "weak", "doubtful", "no_feature", "unexplained"});
}
constexpr auto spellings(ProfileVerdict) {
  return std::to_array<std::string_view>({"", "bounded", "one-sided", "flat"});
}

/// An enumeration with spellings.
template <class Enum>
concept Spelled = requires(Enum value) {
  spellings(value);
};

/// @returns the value's spelling, e.g. "good_correlated".
template <Spelled Enum>
[[nodiscard]] constexpr std::string_view name(Enum value) {
  return spellings(value)[static_cast<std::size_t>(value)];
}

/// One parameter as the fit leaves it.
struct FitParameter {
  std::string name;    ///< with its unit, e.g. "radius_m"
  double value = 0.0;  ///< [unit]
  double sigma = 0.0;  ///< standard deviation; 0 if fixed, infinity where nothing sees it
  std::string unit;    ///< SI, e.g. "rad/s"; "1" for a pure number
  ParameterStatus status = ParameterStatus::free;
  /// Known to better than its own size: the standard deviation, however finite, is below the
  /// parameter's natural size (its value, 1 rad, the extent of the path, one per duration).
  bool identifiable = true;
  std::string note;  ///< e.g. "only the product Is * omega_s is determined"
};

/// One arc of a track: between release, impacts and rest the motion is smooth.
struct FitArc {
  int track = 0;        ///< which of the tracks given, from 0
  int object = 0;       ///< number of the body in its recording, >= 0
  double from_s = 0.0;  ///< time of the first sample [s]
  double to_s = 0.0;    ///< time of the last sample [s]
  int samples = 0;      ///< > 0
  /// Factor by which its track's sigmas were re-estimated, of positions if there are any; over a
  /// first guess where the track came without them.
  double noise_scale = 1.0;
};

/// A direction of parameter space the data do not see.
struct NullVector {
  std::map<std::string, double> components;  ///< parameter name -> weight (scaled, unit length)
  std::string words;                         ///< the same for people
};

/// What only some readings tell.
struct BrokenDegeneracy {
  std::string readings;                 ///< tilt, precession, spin, or angles: all of these
  std::vector<std::string> parameters;  ///< names of those not known without them
  std::string words;                    ///< the same for people
};

/// A rung of the ladder that was tried. Figures of a model that has no fit are NaN.
struct ModelScore {
  std::string model;  ///< in words: the law, then its losses
  double chi2 = 0.0;  ///< of the residuals over the track's own sigmas, >= 0
  /// Information criteria, comparable within one comparison; with the odds of what is unlikely
  /// beforehand, such as a wet floor.
  double aicc = 0.0, bic = 0.0;
  double whiteness_p = 0.0;          ///< p-value of the residuals being white, 0..1
  double held_back_rms_sigma = 0.0;  ///< of the last third; NaN: none seen
  int parameters = 0;                ///< number of free ones
  bool recommended = false;          ///< the simplest that suffices; true for one at the most
  std::string reason;                ///< why there is no fit, or why it is not accepted; else empty
};

/// How well the best fit of everything else holds at fixed values of one parameter.
struct Profile {
  std::string parameter;  ///< its name
  ProfileVerdict verdict = ProfileVerdict::none;
  /// Where chi-square has risen by the 95 % quantile; the end of the parameter's range (0,
  /// -+infinity) on a side without a bound.
  double lower_95 = 0.0, upper_95 = 0.0;
  std::vector<double> values;      ///< ascending [the parameter's unit]
  std::vector<double> delta_chi2;  ///< rise of chi-square there, common errors allowed for
};

/// Spread of one parameter over fits to resampled residuals.
struct BootstrapSpread {
  std::string parameter;                  ///< its name
  double sigma = 0.0;                     ///< standard deviation [the parameter's unit]
  double lower_95 = 0.0, upper_95 = 0.0;  ///< 2.5 % and 97.5 % quantiles [the parameter's unit]
};

/// Error bars that assume neither Gaussian nor independent noise.
struct Bootstrap {
  int draws = 0;       ///< 0: not asked for
  int failed = 0;      ///< draws without a fit
  double block_s = 0;  ///< residuals were resampled in blocks of this length [s]
  std::vector<BootstrapSpread> parameters;  ///< the free ones
};

/// Result of a fit; survives a trip through its JSON file. Names of initial-state parameters of arc
/// i > 0 carry the suffix "@i".
struct Fit {
  std::string model;       ///< as [model] name in the scene: top, rolling ...
  bool converged = false;  ///< whether the outcome is "converged"
  FitOutcome outcome = FitOutcome::none;
  std::string reason;  ///< one sentence
  FitVerdict verdict = FitVerdict::none;
  std::string verdict_words;  ///< the same as a sentence
  /// Which start won: integral_matching, integrals (the motion of a pin), windows, spectrum (a fast
  /// top), spin (a rim in steady rolling), slip (one that slips at first), rolls_first (one that
  /// rolls at first), multiple_shooting, multistart, given, other_model (what another model
  /// compared came to), none (no start led anywhere); mixed if those of several arcs differ.
  std::string start_path;
  std::vector<FitParameter> parameters;       ///< free, fixed and derived ones
  std::vector<std::string> covariance_names;  ///< free parameters, in the order of the rows
  /// [product of the two parameters' units]. Of a top whose nutation is not seen by curvature,
  /// while the sigmas that this hides are infinite.
  Eigen::MatrixXd covariance;
  double chi2 = 0.0;         ///< of the residuals over their sigmas, robustly weighted, >= 0
  int dof = 0;               ///< degrees of freedom: measurements less free parameters
  double noise_scale = 1.0;  ///< the arcs' largest, of tracks with sigmas of their own if any has
  double aicc = 0.0, bic = 0.0;     ///< information criteria, correlated residuals allowed for
  double whiteness_p = 0.0;         ///< p-value of the residuals being white, 0..1
  double correlation_time_s = 0.0;  ///< over which residuals hang together [s]; 0 if white
  int rank = 0;                     ///< directions of parameter space the data see
  double condition = 0.0;  ///< largest over least singular value of the scaled Jacobian, >= 1
  std::vector<NullVector> null_vectors;               ///< the directions the data do not see
  std::vector<BrokenDegeneracy> broken_degeneracies;  ///< by angles seen in the recording
  double integration_error_sigma = 0.0;  ///< largest integration error in units of sigma
  double time_origin_s = 0.0;            ///< t_s the initial state refers to (first arc) [s]
  std::vector<FitArc> arcs;              ///< in the order of the tracks and of time
  std::vector<ModelScore> comparison;    ///< models tried; empty where none were compared
  std::string recommendation;            ///< one sentence about the comparison
  std::vector<Profile> profiles;         ///< empty unless asked for
  Bootstrap bootstrap;
  std::vector<std::string> warnings;            ///< a sentence each
  std::map<std::string, std::string> inputs;    ///< file name -> sha256
  std::map<std::string, std::string> versions;  ///< program and libraries
  std::uint64_t seed = 0;                       ///< of everything random in the fit
  std::string scene_toml;  ///< the scene as resolved, so that the fit can be replayed alone

  /// @returns the parameter of that name, or null.
  [[nodiscard]] const FitParameter* find(const std::string& name) const;
  /// The same of an arc: its own ("x_m@1") if it has one, else the one all arcs share.
  [[nodiscard]] const FitParameter* find(const std::string& name, std::size_t arc) const;
  /// The same of an initial state: one that is told of the first arc alone is no other's, unless it
  /// is fixed, which it is for all.
  [[nodiscard]] const FitParameter* find_state(const std::string& name, std::size_t arc) const;
};

}  // namespace trochoid::data
