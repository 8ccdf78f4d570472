#pragma once
#include <functional>
#include <string>

#include "problem.hpp"
#include "starts.hpp"

namespace trochoid::fitting {

/// Gives starts for a window of an arc, best first; may be empty.
using Starter = std::function<std::vector<Start>(const ArcData& window)>;

/// Where a search ended.
struct Found {
  Solution solution;
  std::string path = "none";  ///< which start won
  double reduced_chi2 = 0.0;  ///< on the full arc, before robust weights
  bool passed = false;        ///< the chi-square gate
};

/// Writes a start's values into every arc of a problem (names the model lacks are skipped).
void apply(const Start& start, Problem& problem);

/// Chi-square per degree of freedom that counts as "explained", for that many rows: 4 standard
/// deviations of the chi-square distribution above 1 and a tenth for imperfect sigmas.
[[nodiscard]] double chi2_gate(int rows);

/// Levenberg-Marquardt on a thinned window, then on windows twice as long each, then on all
/// samples.
/// @param first_window samples of the first window.
[[nodiscard]] Found grow(const Problem& problem, const Start& start, int first_window);

/// The search for a single arc without a guess: windows of 1, 1/2, 1/4, ... of the arc, starts from
/// each, grown; stops at the first solution that passes the gate, else returns the best one.
[[nodiscard]] Found search(const Problem& problem, const Starter& starter);

/// The best start of the whole arc, taken to its minimum and no further: what search() improves on.
[[nodiscard]] Found from_best_start(const Problem& problem, const Starter& starter);

/// Spin angle and spin of a top from the measured spin angle, once its path is known: both enter
/// the prediction as psi_0 + omega_s t, so the difference to a prediction without them is a line.
void start_top_spin(Problem& problem, int arc);

/// Fills in the state of a model at an instant from the data (and the parameters in `values`).
using NodeStarter = std::function<void(double t_s, Eigen::VectorXd& values)>;

/// Multiple shooting for a single arc: the arc is cut into segments with a state each, which
/// `nodes` starts from the data; continuity is imposed on the linearised chain, which is condensed
/// to the first state and the dynamics before it is solved. Ends with a single-shooting polish.
[[nodiscard]] Found multiple_shooting(const Problem& problem, int segments,
                                      const NodeStarter& nodes);

}  // namespace trochoid::fitting
