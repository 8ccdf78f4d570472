#include "choose/off_level.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "choose/leave_out.hpp"
#include "choose/terms.hpp"

namespace trochoid::fitting {
namespace {

// A known rung on a floor off level, not fitted yet; none where it is so already, or the scene says
// how its floor lies.
std::optional<Rung> off_level(const Contest& contest, const Rung& known) {
  const std::optional<int> slope = slope_term(contest.ladder);
  Terms terms = known.terms;
  if (!slope || !terms.insert(*slope).second) return std::nullopt;
  return rung_with(contest.ladder, terms);
}

// Where the slope is expected beside a chosen rung; nothing where little speaks for it.
std::optional<Nearby> expected_slope(const Contest& contest, const Rung& chosen,
                                     const Rung& sloped) {
  const auto test = score_test(contest.tracks, chosen, contest.options, sloped, {{0, {}}});
  if (!test) return std::nullopt;
  const ScoreTest::Change& change = test->instead.at(0);
  const double price = change.parameters * std::log(test->rows);
  if (!(test->before - change.chi2 > price + kVeryStrong)) return std::nullopt;
  return nearby(*test, change);
}

}  // namespace

bool try_slope(const Contest& contest, const Rung& known, Rungs& rungs) {
  std::optional<Rung> sloped = off_level(contest, known);
  if (!sloped) return false;
  const FitOptions options = options_for(*sloped, contest.options);
  if (known.first_part.empty())
    fit_rung(contest.tracks, &known, nullptr, options, *sloped, Reach::from_below);
  else
    fit_from_first_part(contest.tracks, known.first_part, options, *sloped);
  if (!explains(*sloped)) return false;
  step_down(contest, rungs.emplace_back(*std::move(sloped)), rungs);
  return true;
}

void search_on_slope(const Contest& contest, Rungs& rungs) {
  const std::optional<int> slope = slope_term(contest.ladder);
  if (!slope ||
      std::any_of(rungs.begin(), rungs.end(), [](const Rung& rung) { return explains(rung); }))
    return;
  Terms terms = usual_losses(contest.ladder);
  terms.insert(*slope);
  if (is_known(rungs, terms)) return;
  const Rung& searched = add_searched(contest, terms, rungs);
  if (explains(searched)) step_down(contest, searched, rungs);
}

bool slope_instead(const Contest& contest, const Rung& chosen, Rungs& rungs) {
  if (!chosen.fit.converged || chosen.fit.whiteness_p >= kWhite) return false;
  std::optional<Rung> sloped = off_level(contest, chosen);
  if (!sloped) return false;
  const std::optional<Nearby> near = expected_slope(contest, chosen, *sloped);
  if (!near) return false;
  const FitOptions options = options_for(*sloped, contest.options);
  fit_neighbour(contest.tracks, chosen, options, *sloped, *near);
  if (!sloped->fitted || !sloped->fit.converged) return false;
  const double counts = variance_inflation(contest.tracks, *sloped, contest.options);
  if (!(chosen.bic - sloped->bic > kVeryStrong * counts)) return false;
  step_down(contest, rungs.emplace_back(*std::move(sloped)), rungs);
  return true;
}

}  // namespace trochoid::fitting
