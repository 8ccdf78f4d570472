#pragma once
#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "trochoid/data/camera.hpp"
#include "trochoid/data/fit.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/data/track.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::fitting {

/// Where a search starts and how it goes on from there. `automatic` is what a fit is for; the
/// others are for comparisons, and all but `brief` and `integral` go on from the given start alone.
enum class Strategy {
  automatic,    ///< data-driven starts, then the given one, then multiple shooting
  brief,        ///< the same with the likeliest of these starts alone
  integral,     ///< the data-driven start and nothing after it
  single,       ///< single shooting
  growing,      ///< on windows that grow
  multiple,     ///< multiple shooting, of a top
  rolls_first,  ///< of a sliding body: rolling for a while, then into sliding
};

struct FitOptions {
  std::string model;  ///< overrides the scene's
  bool free_pivot = false;
  std::string from, to;  ///< seconds or "f" frames
  /// Share of each track's samples, at its end, that is not fitted; in 0..1, not 1.
  double hold_back = 0.0;
  bool profile = false;  ///< profile likelihood of all but the initial angles and places
  int bootstrap = 0;     ///< block bootstrap draws, 0 = off
  std::uint64_t seed = 1;
  int threads = 0;         ///< 0 = all cores; the result does not depend on it
  double tolerance = 0.0;  ///< integrator tolerance; 0 = chosen so that its error is < 1 % of sigma
  /// By which the tracks were measured, with what it leaves open; null: what the scene's file says.
  const data::Camera* camera = nullptr;
  Strategy strategy = Strategy::automatic;
  std::map<std::string, double> start;  ///< given start by parameter name; overrides the scene's
  std::string start_path = "given";     ///< what data::Fit::start_path calls it
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
/// @throws InputError if the scene lacks what the model needs, the given start names a parameter
///         that the model does not have, the strategy is not for the model, or an option is out of
///         its range; TrackError if a track is unusable.
[[nodiscard]] data::Fit fit(std::span<const data::Track> tracks, const data::Scene& scene,
                            const FitOptions& options = {});

/// The same for a predictor of one's own. The scene contributes [fit], [body] and the pivot only.
[[nodiscard]] data::Fit fit(std::span<const data::Track> tracks, const model::Predictor& predictor,
                            const data::Scene& scene, const FitOptions& options = {});

/// What fit() refuses a scene for whatever the tracks: before there are any, which takes time.
/// @throws InputError if the scene lacks what its model needs, or [fit] names what the model does
///         not have or gives it a value that it cannot have.
void check_scene(const data::Scene& scene, const FitOptions& options = {});

/// The values of all parameters of a predictor, made of the scene that a fit is of, in one of its
/// arcs; what the fit says nothing of as the predictor has it.
[[nodiscard]] Eigen::VectorXd fitted_values(const model::Predictor& predictor, const data::Fit& fit,
                                            std::size_t arc = 0);

/// The scene as a fit of it takes it: with what [fit] prior says in place of what the body and its
/// surroundings are given to be (mass_kg, gravity_m_s2, ...).
[[nodiscard]] data::Scene scene_as_fitted(const data::Scene& scene);

/// Makes the body of a scene_as_fitted() as large as it is by a fitted scale (measured over true
/// length) where its known radius gave the metres; else it is as large as it was.
void resize(data::Scene& scene, double scale);

/// What a fit predicts for one of its arcs as the recording shows it: with the scale, the frame
/// rate and the clocks that were fitted (`scale`, `frame_rate_factor`, `readout_s`,
/// `angle_delay_s`).
/// @param scene    the fit's, its model named.
/// @param request  times by the recording's clock, lengths by its metres; no derivatives.
/// @param row_px   for each time the row of the image where the body is; used, and needed, where
///                 readout_s was fitted: a row that is missing or NaN counts as the first.
/// @throws InputError if the scene does not suit its model, or readout_s was fitted and the image's
///         height is unknown.
[[nodiscard]] model::Prediction fitted_prediction(const data::Fit& fit, const data::Scene& scene,
                                                  std::size_t arc,
                                                  const model::PredictRequest& request,
                                                  const std::vector<double>& row_px = {});

/// The minimiser's library logs rejected steps to stderr; a program that does not want that calls
/// this once before the first fit.
void silence_solver_log();

}  // namespace trochoid::fitting
