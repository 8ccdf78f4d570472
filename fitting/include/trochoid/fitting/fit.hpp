#pragma once
#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <string>

#include "trochoid/data/fit.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/data/track.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::fitting {

struct FitOptions {
  std::string model;  ///< overrides the scene's
  bool free_pivot = false;
  std::string from, to;    ///< seconds or "f" frames
  double hold_back = 0.0;  ///< share of each track's samples, at its end, that is not fitted
  bool profile = false;    ///< profile likelihood of all but the initial angles and places
  int bootstrap = 0;       ///< block bootstrap draws, 0 = off
  std::uint64_t seed = 1;
  int threads = 0;         ///< 0 = all cores; the result does not depend on it
  double tolerance = 0.0;  ///< integrator tolerance; 0 = chosen so that its error is < 1 % of sigma
  /// auto: data-driven starts, then the given one, then multiple shooting. For comparisons:
  /// integral, the data-driven start and nothing after it; and from the given start alone single
  /// (single shooting), growing (windows), multiple (multiple shooting).
  std::string strategy = "auto";
  std::map<std::string, double> start;  ///< given start by parameter name; overrides the scene's
  /// A sliding body rolls when the record begins: its velocity there follows from its spin. What a
  /// slip that friction has ended by the second sample was is not seen, and what goes with it is
  /// not known either. Where friction sets in softly it creeps at first as it would later. For one
  /// arc and a scene that says nothing of that velocity; else nothing changes.
  bool rolls_at_first = false;
  /// What is being done now, with every minimisation. Called from several threads.
  std::function<void(const std::string& stage)> progress;
  /// One line per stage and minimisation. Called from several threads.
  std::function<void(const std::string& line)> log;
};

/// Fits the scene's model to the tracks (several: shared dynamics, own initial states).
/// An unwelcome answer (no convergence, not identifiable, too short) is an outcome in the Fit.
/// @throws InputError if the scene lacks what the model needs, or the given start names a parameter
///         that the model does not have; TrackError if a track is unusable.
[[nodiscard]] data::Fit fit(std::span<const data::Track> tracks, const data::Scene& scene,
                            const FitOptions& options = {});

/// The same for a predictor of one's own. The scene contributes [fit], [body] and the pivot only.
[[nodiscard]] data::Fit fit(std::span<const data::Track> tracks, const model::Predictor& predictor,
                            const data::Scene& scene, const FitOptions& options = {});

/// The values of all parameters of a predictor, made of the scene that a fit is of, in one of its
/// arcs; what the fit says nothing of as the predictor has it.
[[nodiscard]] Eigen::VectorXd fitted_values(const model::Predictor& predictor, const data::Fit& fit,
                                            std::size_t arc = 0);

/// The minimiser's library logs rejected steps to stderr; a program that does not want that calls
/// this once before the first fit.
void silence_solver_log();

}  // namespace trochoid::fitting
