#pragma once
#include <functional>
#include <span>
#include <vector>

#include "choose/ladder.hpp"
#include "choose/rung.hpp"

// What the steps of a comparison share: what is to be explained, and which of the rungs known so
// far does that best.
namespace trochoid::fitting {

/// The most terms that are added to a rung one at a time, or make up a first set.
inline constexpr std::size_t kMostTerms = 3;

/// What is to be explained, and by what.
struct Contest {
  const Ladder& ladder;
  std::span<const data::Track> tracks;
  FitOptions options;
};

/// For one of several rungs; what is said of it names it.
[[nodiscard]] FitOptions options_for(const Rung& rung, const FitOptions& options);

/// Calls fit(i, *rungs[i], its options) for each of the rungs, at the same time.
void side_by_side(const Contest& contest, const std::vector<Rung*>& rungs,
                  const std::function<void(std::size_t, Rung&, const FitOptions&)>& fit);

/// Adds a rung with these terms and searches for it from the beginning.
/// @param first_part  Rung::first_part, where a part of the track is known to be explained.
Rung& add_searched(const Contest& contest, const Terms& terms, Rungs& rungs,
                   const FirstPart& first_part = {});

/// A set of terms beside a known rung's, and where its minimum is expected.
struct Neighbour {
  Terms terms;
  Nearby near = {};
};

/// Fits a rung from the solution of a known one; of one that was fitted before keeps the better.
void fit_or_better(const Contest& contest, const Rung& known, const FitOptions& options, Rung& rung,
                   const Nearby& near = {});

/// Whether the rung with these terms is still to be fitted: it is not known, or ended astray.
[[nodiscard]] bool is_open(const Neighbour& neighbour, const Rung& known, Rungs& rungs);

/// Fits the rungs with those of these sets of terms that are open, side by side, from the solution
/// of a known one. @returns them.
std::vector<const Rung*> add_neighbours(const Contest& contest, std::span<const Neighbour> wanted,
                                        const Rung& known, Rungs& rungs);

/// The likeliest rung with these terms that is not only score-tested: a way up may lead where a
/// search did not. Null where there is none.
[[nodiscard]] Rung* known_rung(Rungs& rungs, const Terms& terms);
[[nodiscard]] bool is_known(const Rungs& rungs, const Terms& terms);

/// Adds a rung that is only score-tested (take_from_score_test), unless one with its terms is known
/// or was tested beside another rung with as little BIC.
void add_score_tested(Rung tested, Rungs& rungs);

/// What a score test lets expect of one of its changes.
[[nodiscard]] Nearby nearby(const ScoreTest& test, const ScoreTest::Change& change);

/// Of the rungs that could be fitted; null where there is none.
[[nodiscard]] const Rung* least_bic(const Rungs& rungs);

/// Fewest parameters among those as good as the best; among these the fewest unusual terms, and
/// then the least BIC. Null where none could be fitted.
[[nodiscard]] const Rung* simplest_sufficient(const Ladder& ladder, const Rungs& rungs);

/// Whether all that usually acts was searched for in vain: another search like that is idle.
[[nodiscard]] bool searched_in_vain(const Rungs& rungs);

/// Up to which evidence against it a rung is worth telling of beside another. Those of a sliding
/// body are dear: only what counts in the error bars.
[[nodiscard]] double most_evidence_against(const Rung& known);

}  // namespace trochoid::fitting
