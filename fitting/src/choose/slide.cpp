#include "choose/slide.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "choose/exchange.hpp"
#include "choose/leave_out.hpp"
#include "choose/softness.hpp"
#include "choose/terms.hpp"

namespace trochoid::fitting {
namespace {

// The losses of a rung and of others that are as likely, up to so many.
Terms as_likely(const Rungs& rungs, const Rung& chosen, std::size_t most) {
  std::vector<const Rung*> near;
  for (const Rung& rung : rungs)
    if (rung.fitted && rung.fit.converged && rung.bic < chosen.bic + kStrong) near.push_back(&rung);
  std::sort(near.begin(), near.end(), [](const Rung* a, const Rung* b) { return a->bic < b->bic; });
  Terms terms = chosen.terms;
  for (const Rung* rung : near) {
    Terms more = terms;
    more.insert(rung->terms.begin(), rung->terms.end());
    if (more.size() <= most) terms = std::move(more);
  }
  return terms;
}

// With other losses a body may be seen to roll for longer: those that a first part of the track
// asks for explain more of it, which asks for others. @param known  explains that first part.
// @returns a rung that explains about as long a first part as any, or all of the track; of losses
// that do so alike it has several.
Rung longest_rolling(const Contest& contest, Rung known) {
  constexpr double kSurelyRolling = 0.9;  // of the first part: before its end a slip may have begun
  constexpr double kLonger = 1.05, kAsLong = 0.85;  // of its duration
  constexpr int kMostParts = 4;
  const double from_s = known.first_part.from_s;  // later than the track's where it is cut
  for (int part = 0; part < kMostParts; ++part) {
    const double before_s = known.first_part.until_s - from_s;
    Contest early = contest;
    early.options.to = fmt::format("{:.17g}", from_s + kSurelyRolling * before_s);
    Rungs rungs;
    Rung& first = rungs.emplace_back(rung_with(contest.ladder, known.terms));
    fit_from_values(contest.tracks, known.first_part.values, options_for(first, early.options),
                    first);
    step_down(early, first, rungs);
    const Rung* chosen = exchange_while_worth(early, rungs);
    if (chosen == nullptr || !chosen->fit.converged) break;
    Rung longer = rung_with(contest.ladder, as_likely(rungs, *chosen, kMostTerms));
    fit_from_first_part(contest.tracks, {values_of(chosen->fit), 0.0, 0.0},
                        options_for(longer, contest.options), longer);
    if (explains(longer)) return longer;
    const double after_s = longer.first_part.until_s - from_s;
    if (!longer.first_part.empty() && after_s > kAsLong * before_s) known = std::move(longer);
    if (after_s < kLonger * before_s) break;
  }
  return known;
}

// What seems to roll first and to slide later may creep all the time, where friction sets in
// softly: searched from the beginning, with all that usually acts.
void try_gentle_friction(const Contest& contest, Rungs& rungs) {
  const Terms terms = all_that_usually_acts(contest.ladder, {});
  if (terms.empty()) return;
  Rungs searched;
  const Rung& creeps = add_searched(contest, terms, searched);
  if (explains(creeps)) step_down(contest, rungs.emplace_back(creeps), rungs);
}

}  // namespace

bool slide_after_rolling(const Contest& contest, const Rung& known, Rungs& rungs) {
  const Rung rolling = longest_rolling(contest, known);
  if (explains(rolling)) {
    step_down(contest, rungs.emplace_back(rolling), rungs);
    return true;
  }
  std::vector<std::pair<Terms, FirstPart>> ways{
      {with_last_resort(contest.ladder, rolling.terms), rolling.first_part}};
  if (rolling.terms != known.terms)
    ways.emplace_back(all_that_usually_acts(contest.ladder, {}), known.first_part);
  for (const auto& [terms, part] : ways) {
    if (terms.empty()) continue;  // no floor on which it may slide
    Rung slides = rung_with(contest.ladder, terms);
    fit_from_first_part(contest.tracks, part, options_for(slides, contest.options), slides);
    if (!usable(slides.fit) || !slides.fit.converged) continue;
    const Rung& added = rungs.emplace_back(std::move(slides));
    // What follows the track to its end needs other losses, not another search.
    if (explains(added))
      step_down(contest, added, rungs);
    else
      try_gentle_friction(contest, rungs);
    return true;
  }
  return false;
}

namespace {

// The likeliest rung that rolls and at least follows the track; null where none does.
const Rung* best_that_rolls(const Rungs& rungs) {
  const Rung* best = nullptr;
  for (const Rung& rung : rungs)
    if (rung.fitted && rung.fit.converged && rung.fit.model == "rolling" &&
        rung.fit.verdict != data::FitVerdict::unexplained &&
        (best == nullptr || rung.bic < best->bic))
      best = &rung;
  return best;
}

// -2 ln of a rung's likelihood, but for a constant.
double misfit(const Rung& rung) {
  return rung.fit.bic - rung.parameters * std::log(rung.fit.dof + rung.parameters);
}

bool speaks_for_softness(const Contest& contest, const Rung& soft, const Rung& chosen) {
  return soft.fitted && soft.fit.converged && !softness_is_open(soft) &&
         misfit(chosen) - misfit(soft) >
             kVeryStrong * variance_inflation(contest.tracks, chosen, contest.options);
}

}  // namespace

// With all that usually acts, among which rolling friction had to stand for the creep; then fewer.
bool creep_instead(const Contest& contest, const Rung& chosen, Rungs& rungs) {
  const bool sharp = chosen.fit.model == "rolling" || softness_is_open(chosen);
  const Rung* rolling = best_that_rolls(rungs);
  if (!sharp || chosen.fit.whiteness_p >= kWhite || rolling == nullptr ||
      rolling->fit.arcs.size() != 1)
    return false;
  const Terms terms = all_that_usually_acts(contest.ladder, rolling->terms);
  Rung* const before = known_rung(rungs, terms);
  if (terms.empty() || (before != nullptr && !softness_is_open(*before))) return false;
  Rung creeps = rung_with(contest.ladder, terms);
  fit_creeping(contest.tracks, *rolling, options_for(creeps, contest.options), creeps);
  const bool astray = !creeps.fitted || misfit(creeps) > misfit(*rolling);
  if (astray && !searched_in_vain(rungs)) {  // what it starts from cannot creep
    Rungs searched;
    const Rung& found = add_searched(contest, terms, searched);
    if (found.fitted && !(creeps.fitted && misfit(creeps) < misfit(found))) creeps = found;
  }
  const bool better = speaks_for_softness(contest, creeps, chosen);
  if (!better && creeps.reason.empty())
    creeps.reason = "it explains no more than what residuals that hang together may hide";
  if (before == nullptr)
    rungs.push_back(std::move(creeps));
  else if (better)
    *before = std::move(creeps);
  if (better) step_down(contest, *known_rung(rungs, terms), rungs);
  return better;
}

bool soften_instead(const Contest& contest, const Rung& chosen, Rungs& rungs) {
  if (!softness_is_open(chosen) || chosen.fit.whiteness_p >= kWhite) return false;
  Rung soft = rung_with(contest.ladder, chosen.terms);
  fit_softly_beside(contest.tracks, chosen, options_for(soft, contest.options), soft);
  if (!speaks_for_softness(contest, soft, chosen)) return false;
  Rung& own = *known_rung(rungs, chosen.terms);
  own = std::move(soft);
  step_down(contest, own, rungs);
  return true;
}

bool roll_instead(const Contest& contest, const Rung& chosen, Rungs& rungs) {
  constexpr double kSurelyThere_sigmas = 4.0;
  constexpr double kMost = 1.0;  // hardly any floor grips more
  const data::FitParameter* friction = chosen.fit.find("friction");
  if (chosen.fit.model != "sliding" || !explains(chosen) || chosen.fit.arcs.size() != 1 ||
      friction == nullptr ||
      (friction->value < kMost && friction->value > kSurelyThere_sigmas * friction->sigma))
    return false;
  Terms terms = chosen.terms;
  std::erase_if(terms, [&](int index) {
    return contest.ladder.terms[static_cast<std::size_t>(index)].last_resort;
  });
  Rung* const before = known_rung(rungs, terms);
  if (before != nullptr && explains(*before)) return false;
  Rung rolls = rung_with(contest.ladder, terms);
  fit_rolling(contest.tracks, chosen, options_for(rolls, contest.options), rolls);
  if (!explains(rolls)) return false;
  Rung& added = before != nullptr ? *before : rungs.emplace_back();
  added = std::move(rolls);
  step_down(contest, added, rungs);
  return true;
}

}  // namespace trochoid::fitting
