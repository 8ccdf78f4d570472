#pragma once
#include <deque>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "choose/ladder.hpp"
#include "choose/score_test.hpp"
#include "judge/draft.hpp"
#include "trochoid/fitting/fit.hpp"

namespace trochoid::fitting {

// Evidence by differences of BIC (Kass and Raftery, J. Am. Stat. Assoc. 90, 773, 1995): up to 2
// "not worth more than a bare mention", above 6 "strong", above 10 "very strong". Trackers err a
// little with the motion itself: a further term needs strong evidence.
inline constexpr double kBareMention = 2.0, kStrong = 6.0, kVeryStrong = 10.0;
/// p-value above which residuals count as white.
inline constexpr double kWhite = 0.01;
/// Variance inflation below which residuals that are not white hang together so little that further
/// terms have no tracker's errors to follow.
inline constexpr double kNearlyIndependent = 2.25;
/// What mends a rung that hardly follows the track takes away so much of its chi-square: all else
/// would only follow the tracker's errors.
inline constexpr double kGoodPart = 0.25;

/// A model of the ladder and what became of it.
struct Rung {
  Terms terms;
  std::string name;
  data::Scene scene;
  data::Fit fit;                    ///< error bars by curvature
  std::function<data::Fit()> full;  ///< `fit` with full error bars, which cost as much as a fit
  Settled settled;
  bool rolls_at_first = false;  ///< FitOptions::rolls_at_first
  bool fitted = false;
  bool fitted_anew = false;    ///< from another rung that explained more
  bool by_score_test = false;  ///< not fitted itself, take_from_score_test()
  bool in_vain = false;  ///< searched with all that usually acts; no loss more leads nearer either
  std::string reason;    ///< why there is no fit, or why it is not accepted; else empty
  double held_back_rms_sigma = std::numeric_limits<double>::quiet_NaN();
  int parameters = 0;
  /// What explains the longest first part of the track that a search for it, or for the model that
  /// only rolls, came across.
  FirstPart first_part;
  /// The fit's, less what is known before it: a gap layer far more viscous than air has the odds of
  /// one in a thousand where the scene does not tell of a wet floor.
  double aicc = std::numeric_limits<double>::infinity();
  double bic = std::numeric_limits<double>::infinity();
};

/// References to rungs stay valid while more are added.
using Rungs = std::deque<Rung>;

/// Whether a rung has all terms of another; also where they are the same.
[[nodiscard]] bool has_all_terms_of(const Rung& rung, const Rung& other);

/// Whether a rung with all terms of a known one and more fits the track worse than that, which it
/// cannot but where its search ended elsewhere.
[[nodiscard]] bool ended_above(const Rung& larger, const Rung& known);

/// Whether a fit came to an end, good or bad.
[[nodiscard]] bool usable(const data::Fit& fit);

/// A rung's fit with full error bars; as it is where there are no others.
[[nodiscard]] data::Fit with_full_bars(const Rung& rung);

/// Makes a draft the rung's fit, and what full error bars are made from.
void take(Draft draft, Rung& rung);

/// Free and fixed values by name; empty where there are several arcs.
[[nodiscard]] std::map<std::string, double> values_of(const data::Fit& fit);

/// What allow_for_rivals() goes by beside the rungs.
struct RivalGrounds {
  Terms usual{};                   ///< terms that act on nearly every body
  Terms other_laws{};              ///< by which one of these goes as well that is chosen
  std::set<std::string> losses{};  ///< parameters of the chosen rung's terms, but for its law's
  /// variance_inflation() of the chosen rung, where its residuals are not white.
  double inflation = std::numeric_limits<double>::infinity();
};

/// Widens the error bars of `chosen` by what its parameters change by in other rungs, each weighed
/// by how well AICc speaks for it (Burnham and Anderson, Sociol. Methods Res. 33, 261, 2004, eq.
/// 4): those that follow the same law, lack one of its terms, and that BIC does not rule out; and
/// those with further terms against which BIC's evidence is not strong, by their odds after BIC,
/// whose own error bars count too. Where residuals hang together other terms may follow the
/// tracker's errors: of those with further terms only such count there for which BIC speaks, or
/// whose usual terms leave open whether a loss of the chosen one acts at all, and of these bars
/// other than those of coefficients grow up to a bound. What leaves that open counts without AICc's
/// charge for its terms. That the body may slip at first where the chosen rung rolls counts anyhow.
/// A loss that the chosen rung has grows no further than to nothing. A loss that a rung lacks is
/// zero there. Warns where a bar grows noticeably. Rungs with further terms against which BIC's
/// evidence is strong, for their size, widen all bars up to that bound, but for those that add
/// nothing but usual terms, or the other law of one, which count by AICc; what one of them would
/// change beyond that is said.
void allow_for_rivals(const Rungs& rungs, const Rung& chosen, data::Fit& fit,
                      const RivalGrounds& grounds = {});

/// Whether a rung's verdict is good, good_correlated or weak, and its residuals are white or within
/// 1.3 of the stated noise (a tracker's errors may hang together).
[[nodiscard]] bool explains(const Rung& rung);

/// Whether a rung's verdict is doubtful or unexplained: it hardly follows the track.
[[nodiscard]] bool leaves_much(const Rung& rung);

/// Whether what a rung leaves is white, or hangs together next to nothing.
/// @param inflation  variance_inflation() of the rung.
[[nodiscard]] bool leaves_independent(const Rung& rung, double inflation);

/// How a rung is looked for: searched for where the solution below does not lead to it, or not.
enum class Reach { search, from_below };

/// Fits a rung's scene, first from the solution of the rung below.
/// @param below  the fitted rung this one extends by one term; null for the plainest.
void fit_rung(std::span<const data::Track> tracks, const Rung* below, const Term* term,
              const FitOptions& options, Rung& rung, Reach reach = Reach::search);

/// Lets a sliding body roll where its record begins (FitOptions::rolls_at_first) if the slip found
/// there ends within a few samples, unless there is strong evidence for it.
void let_roll_at_first(std::span<const data::Track> tracks, const FitOptions& options, Rung& rung);

/// The same for a rung beside one that rolls at first, from where that begins: what it says of the
/// start is comparable then. As it is where that leads nowhere, or where it is only score-tested.
void begin_as(std::span<const data::Track> tracks, const Rung& known, const FitOptions& options,
              Rung& rung);

/// What a known rung's tangent plane says of a larger one.
/// @param others  parameters of each of the known rung's terms that may be left out.
/// @returns nothing where nothing can be told: the larger one has too many parameters for the
/// track, or no prediction. Its fit says so.
[[nodiscard]] std::optional<ScoreTest> score_test(
    std::span<const data::Track> tracks, const Rung& known, const FitOptions& options,
    const Rung& larger, const std::map<int, std::set<std::string>>& others);

/// Second thoughts about the fit of the rung that was chosen (second_thoughts.hpp).
void doubt_as_a_whole(std::span<const data::Track> tracks, const Rung& rung,
                      const FitOptions& options, data::Fit& fit);

/// How many times less than its change a rung's chi-square tells, for what its residuals have in
/// common.
[[nodiscard]] double variance_inflation(std::span<const data::Track> tracks, const Rung& known,
                                        const FitOptions& options);

/// Fits a rung from the values that explain a first part of the track, which it may explain more
/// of. A sliding one rolls at first and slides by Coulomb's law from where that ends: friction that
/// sets in gently lets a body creep, which would show in the first part.
void fit_from_first_part(std::span<const data::Track> tracks, const FirstPart& first_part,
                         const FitOptions& options, Rung& rung);

/// Fits a sliding rung from a rolling one's solution, of one arc: it rolls at first, and creeps
/// from then on as friction that sets in gently lets it, or slips where Coulomb's law does as well.
void fit_creeping(std::span<const data::Track> tracks, const Rung& rolling,
                  const FitOptions& options, Rung& rung);

/// Fits a rung with the losses of a known one that slides, whose friction may set in gently, from
/// that one's motion.
void fit_softly_beside(std::span<const data::Track> tracks, const Rung& known,
                       const FitOptions& options, Rung& rung);

/// Fits a rolling rung with the losses of a known one that slides, of one arc, from where that
/// rolls, which it may from the beginning: followed back from there as if it had. Not fitted where
/// that never rolls.
void fit_rolling(std::span<const data::Track> tracks, const Rung& sliding,
                 const FitOptions& options, Rung& rung);

/// Fits a rung from near its solution.
void fit_from_values(std::span<const data::Track> tracks,
                     const std::map<std::string, double>& values, const FitOptions& options,
                     Rung& rung);

/// Where a rung's minimum is expected beside a known one's: what that one's tangent plane says.
struct Nearby {
  std::map<std::string, double> values;  ///< by name; empty: nothing is expected
  double cost = 0.0;                     ///< what chi-square is to rise by; a gain is not relied on
};

/// Whether a rung that lacks terms of a known one, which explains the track, ended far above what
/// is expected of it there: its search ended in another valley. Not of one fitted anew already.
[[nodiscard]] bool ended_astray(const Rung& smaller, const Rung& known, const Nearby& near);

/// Makes a rung with further losses that gain too little by the score test what that says, without
/// a fit, which would creep along beside the known rung's: it is told of, and error bars allow for
/// it.
/// @param inflation  gains in chi-square tell so many times less (variance_inflation()).
void take_from_score_test(const Rung& known, const ScoreTest& test, const ScoreTest::Change& change,
                          double inflation, Rung& rung);

/// Fits a rung that differs by a term or two from `known`, from where it is expected. Where what is
/// found there is clearly worse than that, or nothing is expected, from the solution of `known`
/// itself.
void fit_neighbour(std::span<const data::Track> tracks, const Rung& known,
                   const FitOptions& options, Rung& rung, const Nearby& near = {});

}  // namespace trochoid::fitting
