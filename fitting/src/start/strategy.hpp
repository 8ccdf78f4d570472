#pragma once
#include <functional>
#include <string>

#include "problem/problem.hpp"
#include "start/starts.hpp"

namespace trochoid::fitting {

/// Gives starts for a window of an arc, best first; may be empty.
using Starter = std::function<std::vector<Start>(const ArcData& window)>;

/// Gives states that leave nearly the same path as a known one; may be empty.
using Lookalikes = std::function<std::vector<Start>(const Start& known)>;

/// Where a search ended.
struct Found {
  Solution solution;
  std::string path = "none";  ///< which start won
  /// On the full arc but strays, before robust weights; that of a top's fast twin counts twice.
  double reduced_chi2 = 0.0;
  double unexplained = 1.0;           ///< chi-square over that of knowing nothing (null_chi2)
  bool passed = false;                ///< the chi-square gate
  bool cut_short = false;             ///< the search ended at its limit before anything passed
  std::vector<double> strays_s = {};  ///< times of samples wrong by all others, left out
};

/// The same arcs and values for another predictor; parameters are matched by name.
[[nodiscard]] Problem for_predictor(const Problem& problem, const model::Predictor& predictor);

/// Writes a start's values into every arc of a problem (names the model lacks are skipped).
void apply(const Start& start, Problem& problem);

/// What a solver's variables put the free parameters to, as a start by this path.
[[nodiscard]] Start start_at(const Problem& problem, const Eigen::VectorXd& u,
                             const std::string& path);

/// Chi-square per degree of freedom that counts as "explained", for that many rows: 4 standard
/// deviations of the chi-square distribution above 1 and a tenth for imperfect sigmas.
[[nodiscard]] double chi2_gate(int rows);

/// Rows of residuals beyond the free parameters, at least one.
[[nodiscard]] int free_rows(const Problem& problem);

/// Chi-square of knowing nothing: positions about their mean, turning angles anywhere in a turn.
[[nodiscard]] double null_chi2(const ArcData& arc);

/// A single-arc problem without the samples at these times.
[[nodiscard]] Problem without_samples(const Problem& problem, const std::vector<double>& t_s);

/// A single-arc problem on its first `samples` samples, thinned to a few hundred; losses, which a
/// short window hardly shows, are kept near their given values.
[[nodiscard]] Problem windowed(const Problem& problem, int samples);

/// Where starts ended: samples of a window and chi-square there.
using Valleys = std::vector<std::pair<int, double>>;

struct Growth {
  double rate = 1.5;  ///< samples of a window over those of the one before
  /// Chi-square over its gate at which a window is lost, and the start with it. 0: a window is lost
  /// at several times what the one before left, the start where a window is far from explained.
  double most_over_gate = 0.0;
  /// Where other starts ended, this one's ends are added: one that ends where one before it did is
  /// not followed further. On the first window; on any if the gate is what counts. Null: all are.
  Valleys* known = nullptr;
};

/// Levenberg-Marquardt on a thinned window, then on windows half as long again each, then on
/// all samples. A sample that alone leaves a good part of a window unexplained is left out: one
/// wrong azimuth among dozens of angles outweighs them all.
/// @param first_window samples of the first window.
[[nodiscard]] Found grow(const Problem& problem, const Start& start, int first_window,
                         const Growth& growth = {});

/// Basin hopping where a cost has ripples, as events that come and go with the parameters make
/// them: steps off the best known point, as far as the misfit lets the linearised problem, and
/// downhill again, until `misses` rounds in a row, or a dozen altogether, gained nothing.
/// Reproducible.
[[nodiscard]] Found basin_hop(const Problem& problem, Found best, int misses);

/// Where a solution that falls flat does not pass: a body nods as it falls, and the dip of its tilt
/// in which it comes to lie decides when and where. From one dip to the next the path jumps, and
/// nothing leads downhill over that. What the track says before the fall leaves few dips to choose
/// from: looks about as far as that lets it, and goes downhill on all of the track from the best.
[[nodiscard]] Found restart_around_fall(const Problem& problem, Found found);

enum class Effort { brief, full };

/// The search for a single arc without a guess: windows of 1, 1/2, 1/4, ... of the arc, starts from
/// each that already say something about it, grown; stops at the first solution that passes the
/// gate, or after the window in which the path got explained but for a per cent (a track's sigmas
/// may be too small, or the model not the whole truth). Where nothing passes, more starts are taken
/// downhill on short windows, which then grow more slowly. Returns the best one.
[[nodiscard]] Found search(const Problem& problem, const Starter& starter,
                           Effort effort = Effort::full);

/// The best start of the whole arc, taken to its minimum and no further: what search() improves on.
[[nodiscard]] Found from_best_start(const Problem& problem, const Starter& starter);

/// Spin angle (and spin of a top) from the measured spin angle, once the path is known: they enter
/// the prediction as psi_0 + omega_s t, so the difference to a prediction without them is a line;
/// for other bodies it is a constant.
void start_spin(Problem& problem, int arc);

/// Losses that a minimiser sends to zero creep on for ever on a logarithmic scale: holds those
/// which at their present value no longer change a residual, at a millionth of the given value
/// or, if that would change one, below; likewise a friction at its limit. Writes u into `base`.
/// Returns whether anything new is held.
bool hold_vanished(Problem& problem, const Eigen::VectorXd& u);

/// Whether a loss of a single-arc problem is next to nothing at u: below a hundredth of its given
/// value.
[[nodiscard]] bool has_vanished(const Problem& problem, const Eigen::VectorXd& u);

/// Levenberg-Marquardt from problem.base to the minimum of a single-arc problem. Losses that vanish
/// on the way are held, and let go again where a score test finds them missed.
[[nodiscard]] Solution solve_to_the_end(Problem& problem);

/// What a solution of a single-arc problem is worth.
[[nodiscard]] Found judged(const Problem& problem, Solution solution, const std::string& path);

/// Whether a is usable and explains more than b.
[[nodiscard]] bool better(const Found& a, const Found& b);

/// Whether the gate is passed, and chi-square at most so many standard deviations of its
/// distribution above what it should be.
[[nodiscard]] bool explained_within(const Problem& problem, const Found& best, double deviations);

/// Whether it is so within half a standard deviation: from positions alone neighbouring valleys
/// pass the gate as well.
[[nodiscard]] bool surely_explained(const Problem& problem, const Found& best);

/// Whether the search has used up its steps (less than a minute's, half of that where angles were
/// seen): the best so far has to do, and the verdict says what it is worth.
[[nodiscard]] bool exhausted(const Problem& problem, const Found& best);

/// Whether the path is explained but for a per cent of its amplitude: a tracker's sigmas may be too
/// small, or the model not the whole truth. Stated ones of no camera count: what is far beyond them
/// lies in another valley.
[[nodiscard]] bool followed_closely(const Problem& problem, const Found& best);

/// Whether looking on is idle: the path is explained but for a per cent, or the gate is passed;
/// for a sliding body's positions alone, surely explained.
[[nodiscard]] bool surely_found(const Problem& problem, const Found& best);

/// Fills in the state of a model at an instant from the data (and the parameters in `values`).
using NodeStarter = std::function<void(double t_s, Eigen::VectorXd& values)>;

/// Multiple shooting for a single arc: the arc is cut into segments with a state each, which
/// `nodes` starts from the data; continuity is imposed on the linearised chain, which is condensed
/// to the first state and the dynamics before it is solved. Ends with single shooting, roughly:
/// what follows minimises again.
[[nodiscard]] Found multiple_shooting(const Problem& problem, int segments,
                                      const NodeStarter& nodes);

/// Multiple shooting of a top's first nutations from a given start of its dynamics, then single
/// shooting on growing windows. The states between come from the smoothed path; segments are a
/// fifth of a nutation by the start's b, then twice and half of that, until one passes the gate.
/// @throws InputError for another model.
[[nodiscard]] Found shoot_top(const Problem& problem, const Start& start);

}  // namespace trochoid::fitting
