#pragma once
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/prediction.hpp"
#include "common/value_words.hpp"
#include "report/report.hpp"

/// Pieces of the report; see report.cpp for how they are put together.
namespace trochoid::tools {

/// Numbers every part of a report needs, computed once.
struct ReportFacts {
  const ReportInput& input;
  PredictedPath prediction;                      ///< empty without a fit
  std::vector<std::vector<Residual>> residuals;  ///< one list per track
  bool metres = true;  ///< any sample has its place in metres; else all are shown in pixels
  int samples = 0;
  int gaps = 0;      ///< runs of frames without a sample between two samples
  int missing = 0;   ///< frames in those gaps
  int doubtful = 0;  ///< samples of low quality
  double first_s = 0.0, last_s = 0.0;
  int compared = 0;         ///< positions that were predicted
  int far_off = 0;          ///< those of them that an accepted fit gave up, in neither rms
  double rms_axis_m = 0.0;  ///< residual per axis
  double rms_axis_sigma =
      0.0;  ///< the same in sigmas of the track (before rescaling); NaN if unknown
  double rms_spin_rad = 0.0;    ///< residual of the spin angle; NaN if it is not seen or predicted
  double median_sigma_m = 0.0;  ///< of the track per axis; NaN if unknown
};
/// Whether any sample of a track has its place in metres.
[[nodiscard]] bool has_metres(const data::TrackFile& file);
[[nodiscard]] ReportFacts gather(const ReportInput& input);

// --- words ---
struct Verdict {
  std::string grade;  ///< good | fair | bad | none
  std::string word;   ///< for people
  std::string sentence;
  std::vector<std::string> remarks;
};
[[nodiscard]] Verdict judge(const ReportFacts& facts);

// --- figures (SVG) ---
[[nodiscard]] std::string path_figure(const ReportFacts& facts);
/// Whitened residuals against the normal distribution, and their autocorrelation.
[[nodiscard]] std::string histogram_figure(const ReportFacts& facts);
[[nodiscard]] std::string correlation_figure(const ReportFacts& facts);
/// Error of the integration against its run time, measured on this fit's own motion. Empty without.
[[nodiscard]] std::string cost_figure(const ReportFacts& facts);

// --- energy and forces ---
struct DynamicsChart {
  std::string label;           ///< with its unit
  std::vector<double> values;  ///< at the times asked for; NaN where the model does not reach
};
/// Energy, normal force and needed friction of the fitted motion of one object of the input at the
/// given times, as far as its model has them. Forces need the mass.
/// @param track  of input.tracks. @pre input.fit
[[nodiscard]] std::vector<DynamicsChart> dynamics_of(const ReportInput& input,
                                                     const data::Track& track,
                                                     std::span<const double> at_s);

// --- time series ---
/// What report.js draws: per object the times, the charts and the path's cursor positions.
[[nodiscard]] nlohmann::json series_of(const ReportFacts& facts);

}  // namespace trochoid::tools
