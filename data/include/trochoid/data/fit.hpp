#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace trochoid::data {

/// free: estimated; fixed: given; derived: computed from free ones and priors (with propagated
/// sigma); prior: free but carried by its prior, the recording says nothing.
enum class ParameterStatus { free, fixed, derived, prior };

struct FitParameter {
  std::string name;
  double value = 0.0;
  double sigma = 0.0;  ///< standard deviation; 0 if fixed, infinity where nothing sees it
  std::string unit;
  ParameterStatus status = ParameterStatus::free;
  /// Known to better than its own size: the standard deviation, however finite, is below the
  /// parameter's natural size (its value, 1 rad, the extent of the path, one per duration).
  bool identifiable = true;
  std::string note;  ///< e.g. "only the product Is * omega_s is determined"
};

/// One arc of a track: between release, impacts and rest the motion is smooth.
struct FitArc {
  int track = 0;  ///< which track file
  int object = 0;
  double from_s = 0.0;
  double to_s = 0.0;
  int samples = 0;
};

/// A direction of parameter space the data do not see.
struct NullVector {
  std::map<std::string, double> components;  ///< parameter name -> weight (scaled, unit length)
  std::string words;
};

/// A rung of the ladder that was tried. Figures of a model that has no fit are NaN.
struct ModelScore {
  std::string model;
  double chi2 = 0.0, aicc = 0.0, bic = 0.0;
  double whiteness_p = 0.0;          ///< p-value of the residuals being white
  double held_back_rms_sigma = 0.0;  ///< prediction of the held-back last third, in sigmas
  int parameters = 0;
  bool recommended = false;
  std::string reason;  ///< why there is no fit, or why it is not accepted; else empty
};

/// How well the best fit of everything else holds at fixed values of one parameter.
struct Profile {
  std::string parameter;
  std::string verdict;  ///< bounded; one-sided; flat: the data bound it on no side
  /// Where chi-square has risen by the 95 % quantile; the end of the parameter's range (0,
  /// -+infinity) on a side without a bound.
  double lower_95 = 0.0, upper_95 = 0.0;
  std::vector<double> values;      ///< ascending
  std::vector<double> delta_chi2;  ///< rise of chi-square there, correlated residuals allowed for
};

/// Spread of one parameter over fits to resampled residuals.
struct BootstrapSpread {
  std::string parameter;
  double sigma = 0.0;
  double lower_95 = 0.0, upper_95 = 0.0;  ///< 2.5 % and 97.5 % quantiles
};
struct Bootstrap {
  int draws = 0;       ///< 0: not asked for
  int failed = 0;      ///< draws without a fit
  double block_s = 0;  ///< residuals were resampled in blocks of this length
  std::vector<BootstrapSpread> parameters;
};

/// Result of a fit; survives a trip through its JSON file. Names of initial-state parameters of arc
/// i > 0 carry the suffix "@i".
struct Fit {
  std::string model;
  bool converged = false;
  /// One word: converged; no_convergence; unexplained, the best minimum does not follow the track
  /// to its noise; not_identifiable, nothing in the track asks for the model.
  std::string outcome;
  std::string reason;  ///< one sentence
  /// What the fit is worth: good; good_correlated, residuals hang together and error bars are
  /// widened for that; weak, explained but parameters are not determined; doubtful, followed but
  /// residuals beyond twice their noise; no_feature; unexplained.
  std::string verdict;
  std::string verdict_words;  ///< the same as a sentence
  std::string
      start_path;  ///< which start won: integral_matching, windows, shooting, multistart, given
  std::vector<FitParameter> parameters;
  std::vector<std::string> covariance_names;  ///< free parameters, in the order of the rows
  Eigen::MatrixXd covariance;
  double chi2 = 0.0;
  int dof = 0;
  double noise_scale = 1.0;  ///< factor by which the track's sigmas were re-estimated
  double aicc = 0.0, bic = 0.0;
  double whiteness_p = 0.0;
  double correlation_time_s = 0.0;
  int rank = 0;
  double condition = 0.0;
  std::vector<NullVector> null_vectors;
  double integration_error_sigma = 0.0;  ///< largest integration error in units of sigma
  double time_origin_s = 0.0;            ///< t_s the initial state refers to (first arc)
  std::vector<FitArc> arcs;
  std::vector<ModelScore> comparison;
  std::string recommendation;  ///< one sentence about the comparison
  std::vector<Profile> profiles;
  Bootstrap bootstrap;
  std::vector<std::string> warnings;
  std::map<std::string, std::string> inputs;    ///< file name -> sha256
  std::map<std::string, std::string> versions;  ///< program and libraries
  std::uint64_t seed = 0;
  std::string scene_toml;  ///< the scene as resolved, so that the fit can be replayed alone

  [[nodiscard]] const FitParameter* find(const std::string& name) const;
};

}  // namespace trochoid::data
