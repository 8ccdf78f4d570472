#pragma once
#include "judge/statistics.hpp"
#include "problem/problem.hpp"
#include "trochoid/data/fit.hpp"

namespace trochoid::fitting {

/// Squares of the positions, in units of the track's sigmas: about the prediction, as far as a
/// robust loss lets them count, about their mean, and about a smooth curve. The last is noise only
/// where frames follow each other closely enough; where the prediction scatters likewise, or
/// samples are fewer than kFewestForNoise, it counts for kMisjudged times the stated sigmas at
/// most.
struct Squares {
  bool ok = true;
  double residual = 0.0, motion = 0.0, scatter = 0.0;
};
[[nodiscard]] Squares squares(const Problem& problem, const Solution& solution);

/// What a fit is worth, data::FitVerdict:
///   unexplained      not a minimum; or residuals beyond 4 times the track's sigmas, the samples'
///                    scatter about a smooth curve and 1 % of the motion (angles: 0.2 rad), or
///                    beyond 8 times; or a 30th of the motion's variance left; or a tenth of the
///                    positions, three at least, given up that lie on one path with the others
///   no_feature       a constant, a line, a parabola or a cubic in time explains the positions as
///                    well (BIC): nothing in them asks for the model
///   doubtful         followed, but residuals are beyond 2 times those measures, or a
///                    hundredth of the positions, three at least, given up, or
///                    doubt_as_a_whole() says so
///   weak             explained, but parameters of the motion are not determined
///   good_correlated  explained; residuals hang together, error bars are widened for that
///   good             explained; what is left looks like noise
/// @param cut_short  the search ended at its limit before anything passed its gate: residuals that
///                   do not pass it now, of independent errors, are unexplained.
/// Sets converged, outcome, reason, verdict and verdict_words; warns of residuals above the
/// scatter.
void judge(const Problem& problem, const Solution& solution, const Uncertainty& error,
           bool cut_short, data::Fit& fit);

/// Of tracks that are explained, tells of each of several whose path a polynomial explains as well
/// as the model does with what the others tell of it, as that of a short one. Where such a track's
/// residuals are beyond 4 times its sigmas, a verdict of what is explained becomes doubtful: it
/// need not be the body's.
/// @param u  a minimum, by which the problem's weights are set.
void doubt_if_a_track_shows_nothing(const Problem& problem, const Eigen::VectorXd& u,
                                    data::Fit& fit);

/// Whether a fit's verdict is one of a track that is explained: good, good_correlated or weak.
[[nodiscard]] bool says_explained(const data::Fit& fit);

/// Whether a path is neither unexplained nor doubtful for its residuals.
[[nodiscard]] bool explains(const Problem& problem, const Solution& solution);

}  // namespace trochoid::fitting
