#pragma once
#include <optional>
#include <span>

#include "judge/statistics.hpp"
#include "judge/upright_top.hpp"
#include "problem/problem.hpp"
#include "trochoid/data/fit.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/data/track.hpp"

/// What must be said of a fit beside its numbers: heed_...() widens error bars for it, tell_...()
/// says it; both add to the fit's warnings.
namespace trochoid::fitting {

/// The error bar of friction reaches as far as chi-square does on its flatter side; what goes with
/// friction goes farther with it.
void heed_far_side(const Problem& problem, const Solution& solution, int threads,
                   Uncertainty& error, data::Fit& fit);

/// The error bar of l reaches as far up as chi-square lets it; tilt and tilting rate go with it.
void heed_upright_top(const Problem& problem, const Solution& solution, const UprightTop& top,
                      Uncertainty& error, data::Fit& fit);

/// What is left to say where nothing limits it; to be told when the parameters are described.
void tell_open_length(const Problem& problem, const Solution& solution, const UprightTop& top,
                      data::Fit& fit);

/// What one sample alone tells, which may be wrong by more than its error says, is known no better
/// than as far as it goes without that sample.
void heed_single_samples(const Problem& problem, const Solution& solution, Uncertainty& error,
                         data::Fit& fit);

/// What the model takes for given is known as well as its priors say, and no better; and a puck
/// whose spin nothing shows may turn, either way round.
/// @param frame_s  as of observed().
void heed_doubts(const Problem& problem, const Solution& solution, const data::Scene& scene,
                 double frame_s, Uncertainty& error, data::Fit& fit);

/// Priors of what the model does not have.
void tell_idle_priors(const Problem& problem, const data::Scene& scene, data::Fit& fit);

/// Tracks of which no stretch was fitted: a puck may slide in some and not in others.
void tell_unused_tracks(const Problem& problem, std::span<const data::Track> tracks,
                        data::Fit& fit);

/// A recording's own rate and one that is given for its camera may differ: then only what the
/// latter says of its own error is taken.
void tell_other_rate(const data::Scene& scene, std::span<const data::Track> tracks, data::Fit& fit);

/// Error bars that the camera's calibration makes up most of; a camera that has gone. To be told
/// when the error bars are all they will be.
void tell_camera(const Problem& problem, const Uncertainty& error, const data::Scene& scene,
                 data::Fit& fit);

/// A puck's friction whose error bar is little beside what a floor that is hardly off level would
/// do.
/// @param frame_s  as of observed().
void tell_rise(const Problem& problem, const Solution& solution, const Uncertainty& error,
               const data::Scene& scene, double frame_s, data::Fit& fit);

/// Slips of units that a fit would follow without a word.
void tell_unlikely_body(const data::Scene& scene, data::Fit& fit);

/// A fitted friction no pair of surfaces has: the track's positions or times are in other units.
void tell_unlikely_friction(data::Fit& fit);

/// A fitted slope of the floor, as an angle.
void tell_slope(data::Fit& fit);

/// Positions and angles that were all but given up (reweight): their number is no longer what the
/// fit stands on.
void tell_given_up(const Problem& problem, data::Fit& fit);

/// A bound under [fit] that a value has come to.
struct BoundStoodAt {
  double value = 0.0;
  bool lower = true;
};

/// That of a free parameter; nothing where it has none, or stands off it.
[[nodiscard]] std::optional<BoundStoodAt> bound_stood_at(const Problem& problem,
                                                         const Eigen::VectorXd& u,
                                                         const Uncertainty& error,
                                                         const data::FitSettings& settings,
                                                         int index);

/// Values that stand at a bound under [fit].
void tell_bounds(const Problem& problem, const Solution& solution, const Uncertainty& error,
                 const data::Scene& scene, data::Fit& fit);

/// What [fit] holds, for where nothing fits well.
void tell_held(const data::Scene& scene, data::Fit& fit);

/// A pivot is freed in vain where there is none.
void tell_idle_pivot(const Problem& problem, const data::Scene& scene, data::Fit& fit);

/// Terms of other models; [start] is a hint for whichever wants it.
void tell_idle_terms(const data::Scene& scene, data::Fit& fit);

}  // namespace trochoid::fitting
