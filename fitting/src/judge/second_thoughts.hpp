#pragma once
#include "judge/statistics.hpp"
#include "problem/problem.hpp"
#include "trochoid/data/fit.hpp"

namespace trochoid::fitting {

/// Second thoughts about a fit that is what was asked for; models are compared without them, since
/// further terms may take their reason away. Lowers a verdict of what is explained to doubtful
/// where
///   - one of several tracks shows nothing of the motion and scatters far more than it states
///     (adequacy.hpp);
///   - times are off by whole frames from some sample on (lost_pictures.hpp);
///   - the second half of the record asks for other parameters than the first, its noise allowed
///     for: the model then lacks something that the parameters stand in for, and their error bars
///     do not know of it. A tracker's errors go with the motion a little, too: of filmed positions
///     more is asked;
///   - at least half of the first or last positions of an arc stand out, eight of them or three
///     times as many as hang together: the body moves there as the model does not let it, and the
///     state at the first sample is the model's path followed back to it. Of three or more a
///     tracker may have missed, and a warning tells;
///   - a puck's arcs have frictions that differ beyond all chance (one_friction.hpp);
///   - a prior, a fixed value, a bound, or one of several tracks contradicts the rest
///     (contradictions.hpp).
/// @param settings  [fit] of the scene.
/// @param u  a minimum, by which the problem's weights are set.
void doubt_as_a_whole(const Problem& problem, const Eigen::VectorXd& u, const Uncertainty& error,
                      const data::FitSettings& settings, data::Fit& fit);

}  // namespace trochoid::fitting
