#include "choose/climb.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "choose/leave_out.hpp"
#include "choose/off_level.hpp"
#include "choose/slide.hpp"
#include "choose/terms.hpp"

namespace trochoid::fitting {
namespace {

// All extensions of a rung by one term, tried at the same time. @returns the best of it and them.
const Rung& step_up(const Contest& contest, bool last_resort, Reach reach, const Rung& current,
                    Rungs& rungs) {
  const Ladder& ladder = contest.ladder;
  std::vector<Rung*> larger;
  std::vector<const Term*> added;
  for (int index = 0; index < static_cast<int>(ladder.terms.size()); ++index) {
    const Term& term = ladder.terms[static_cast<std::size_t>(index)];
    Terms terms = current.terms;
    if (term.last_resort != last_resort || term.smooth || term.slope ||
        !means_something(ladder, terms, index) || !terms.insert(index).second)
      continue;
    larger.push_back(&rungs.emplace_back(rung_with(ladder, terms)));
    added.push_back(&term);
  }
  side_by_side(contest, larger, [&](std::size_t i, Rung& rung, const FitOptions& options) {
    fit_rung(contest.tracks, &current, added[i], options, rung, reach);
  });
  const Rung* best = &current;
  for (const Rung* rung : larger)
    if (rung->fitted && (!best->fitted || rung->bic < best->bic)) best = rung;
  return *best;
}

// One more term at a time, from one of the rungs on, while each is worth it. @returns the last one.
const Rung& step_up_while_worth(const Contest& contest, Reach reach, const Rung& from,
                                Rungs& rungs) {
  if (reach == Reach::from_below && !from.fitted) return from;  // nothing to go on from
  const Rung* current = &from;
  for (std::size_t size = 1; size <= std::min(kMostTerms, contest.ladder.terms.size()); ++size) {
    const Rung& best = step_up(contest, false, reach, *current, rungs);
    if (&best == current || !(best.bic < current->bic - kStrong)) break;
    current = &best;
  }
  return *current;
}

// A rung that explains the track where `known` does not, with another law for one of its losses.
// Where there is a last resort that is the likelier one.
std::optional<Rung> by_another_law(const Contest& contest, const Rung& known) {
  const Ladder& ladder = contest.ladder;
  if (!with_last_resort(ladder, {}).empty()) return std::nullopt;
  Rungs tried;
  std::vector<Rung*> others;
  std::vector<const Term*> laws;
  for (int index = 0; index < static_cast<int>(ladder.terms.size()); ++index) {
    const Term& term = ladder.terms[static_cast<std::size_t>(index)];
    if (!term.other_law_of || !known.terms.contains(*term.other_law_of)) continue;
    Terms terms = known.terms;
    terms.erase(*term.other_law_of);
    terms.insert(index);
    others.push_back(&tried.emplace_back(rung_with(ladder, terms)));
    laws.push_back(&term);
  }
  side_by_side(contest, others, [&](std::size_t i, Rung& rung, const FitOptions& options) {
    fit_rung(contest.tracks, &known, laws[i], options, rung);
  });
  const Rung* best = least_bic(tried);  // of the others a longer way may make more
  return best != nullptr && explains(*best) ? std::optional(*best) : std::nullopt;
}

// A rung that explains the track, with further losses beside those of `known`, which explains a
// first part alone: one is added at a time while each helps.
std::optional<Rung> with_further_losses(const Contest& contest, const Rung& known) {
  double known_bic = known.bic;
  std::vector<Terms> sets = with_one_more(contest.ladder, known.terms);
  for (std::size_t more = 1; more <= kMostTerms; ++more) {
    Rungs tried;
    std::vector<Rung*> larger;
    for (const Terms& terms : sets)
      larger.push_back(&tried.emplace_back(rung_with(contest.ladder, terms)));
    side_by_side(contest, larger, [&](std::size_t, Rung& rung, const FitOptions& options) {
      fit_from_first_part(contest.tracks, known.first_part, options, rung);
    });
    const Rung* best = least_bic(tried);  // of the others a search of their own may make more
    if (best != nullptr && explains(*best)) return *best;
    // Two may act that each alone follow the track not much farther.
    if (best == nullptr || !(best->bic < known_bic - kVeryStrong)) break;
    known_bic = best->bic;
    sets = with_one_more(contest.ladder, best->terms);
  }
  return std::nullopt;
}

// Where the plainest model explains nothing its solution leads nowhere, and neither does that of
// one with a single loss if several act: all usual losses together, then fewer of them. Where that
// explains a first part of the track alone, further losses act as well, or the body slides from
// there on. @returns whether one of these explains the track, or follows it and is to go on from.
bool climb_down(const Contest& contest, Rungs& rungs) {
  const Terms usual = usual_losses(contest.ladder);
  if (usual.empty()) return false;
  const Rung& all = add_searched(contest, usual, rungs);
  if (explains(all)) {
    step_down(contest, all, rungs);
    return true;
  }
  // Nothing else leads a rolling body astray like a slope; one that slides air slows much alike.
  if (contest.ladder.law == "rolling" && try_slope(contest, all, rungs)) return true;
  std::optional<Rung> other = by_another_law(contest, all);
  if (!other) {
    if (all.first_part.empty()) return false;
    other = with_further_losses(contest, all);
  }
  if (!other) return slide_after_rolling(contest, all, rungs);
  step_down(contest, rungs.emplace_back(*std::move(other)), rungs);
  return true;
}

// On a floor without friction, where the ladder has one. @returns whether that explains the track.
bool try_smooth_floor(const Contest& contest, const Rung& best, Rungs& rungs) {
  const std::optional<int> none = smooth_term(contest.ladder);
  if (!none) return false;
  const Rung* smooth = &add_searched(contest, {*none}, rungs);
  if (smooth->fitted && smooth->bic < best.bic)
    smooth = &step_up_while_worth(contest, Reach::search, *smooth, rungs);
  if (!smooth->fit.converged || !explains(*smooth)) return false;
  step_down(contest, *smooth, rungs);
  return true;
}

// The last resort alone, beside the best so far; where nothing leads anywhere, that does not
// either. @returns whether it explains the track.
bool by_last_resort(const Contest& contest, const Rung& best, Rungs& rungs) {
  if (!best.fit.converged) return false;
  const Rung& last = step_up(contest, true, Reach::search, best, rungs);
  if (&last == &best || !explains(last)) return false;
  step_down(contest, last, rungs);
  return true;
}

// The longest part of the track, from its beginning on, that one of the rungs explains.
FirstPart longest_first_part(const Rungs& rungs) {
  FirstPart longest;
  for (const Rung& rung : rungs)
    if (!rung.first_part.empty() && (longest.empty() || rung.first_part.until_s > longest.until_s))
      longest = rung.first_part;
  return longest;
}

// All that usually acts, the last resort with it. What helped a model that explains nothing tells
// nothing.
void by_all_that_usually_acts(const Contest& contest, const Rung& known, Rungs& rungs) {
  const Terms all =
      all_that_usually_acts(contest.ladder, known.fit.converged ? known.terms : Terms{});
  if (all.empty()) return;
  Rung& searched = add_searched(contest, all, rungs, longest_first_part(rungs));
  if (explains(searched)) return step_down(contest, searched, rungs);
  if (!searched.fitted) return;  // nothing to go on from
  // Where one loss more leads nearer, it may lead there from another start; where it takes no good
  // part away, as where the scene has a wrong radius, it had only taken another minute.
  Rungs nearer;
  const Rung& nearest = step_up(contest, false, Reach::from_below, searched, nearer);
  if (explains(nearest)) return step_down(contest, rungs.emplace_back(nearest), rungs);
  searched.in_vain =
      leaves_much(searched) && nearest.fit.chi2 > (1.0 - kGoodPart) * searched.fit.chi2;
  if (&nearest == &searched) return;
  if (searched.in_vain)
    rungs.push_back(nearest);
  else
    step_down(contest, add_searched(contest, nearest.terms, rungs), rungs);
}

// The plainest model. Where losses usually act it hardly ever explains a track, and a search of all
// starts is idle before these have been tried.
Rung& add_plainest(const Contest& contest, bool may_lose, Rungs& rungs) {
  Contest first = contest;
  if (may_lose) first.options.strategy = Strategy::brief;
  return add_searched(first, {}, rungs);
}

// Of all starts.
void search_again(const Contest& contest, Rung& rung) {
  Rung again = rung_with(contest.ladder, rung.terms);
  fit_rung(contest.tracks, nullptr, nullptr, options_for(again, contest.options), again);
  if (again.fitted && (!rung.fitted || again.bic < rung.bic)) rung = std::move(again);
}

}  // namespace

Rungs climb(const Contest& contest) {
  Rungs rungs;
  const bool may_lose = !usual_losses(contest.ladder).empty();
  Rung& plainest = add_plainest(contest, may_lose, rungs);
  const bool loses = may_lose && !explains(plainest);
  if (loses && climb_down(contest, rungs)) return rungs;
  if (loses) search_again(contest, plainest);
  // Where a search with all usual losses led nowhere, one with fewer does not either.
  const Reach reach = loses ? Reach::from_below : Reach::search;
  const Rung& best = step_up_while_worth(contest, reach, plainest, rungs);
  if (explains(best)) {
    // What stood in for another loss while that was missing may not be needed beside it.
    step_down(contest, best, rungs);
  } else if (!try_slope(contest, best, rungs) && !try_smooth_floor(contest, best, rungs) &&
             !by_last_resort(contest, best, rungs)) {
    by_all_that_usually_acts(contest, best, rungs);
    search_on_slope(contest, rungs);
  }
  return rungs;
}

}  // namespace trochoid::fitting
