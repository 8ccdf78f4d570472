#include "choose/contest.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <tuple>
#include <utility>

#include "choose/terms.hpp"
#include "trochoid/data/parallel.hpp"

namespace trochoid::fitting {

namespace {

// The likeliest rung with these terms that is only score-tested, or that is not; null where there
// is none.
Rung* rung_of(Rungs& rungs, const Terms& terms, bool by_score_test) {
  Rung* likeliest = nullptr;
  for (Rung& rung : rungs)
    if (rung.terms == terms && rung.by_score_test == by_score_test &&
        (likeliest == nullptr || rung.bic < likeliest->bic))
      likeliest = &rung;
  return likeliest;
}

// A rung with these terms, not fitted yet: a new one, or in the place of one that was only
// score-tested.
Rung& blank_rung(const Ladder& ladder, const Terms& terms, Rungs& rungs) {
  Rung* const before = rung_of(rungs, terms, true);
  Rung& rung = before != nullptr ? *before : rungs.emplace_back();
  return rung = rung_with(ladder, terms);
}

}  // namespace

FitOptions options_for(const Rung& rung, const FitOptions& options) {
  FitOptions own = options;
  const auto named = [name = rung.name](const auto& say) {
    return [name, say](const std::string& words) { say(fmt::format("{}: {}", name, words)); };
  };
  if (options.progress) own.progress = named(options.progress);
  if (options.log) own.log = named(options.log);
  return own;
}

void side_by_side(const Contest& contest, const std::vector<Rung*>& rungs,
                  const std::function<void(std::size_t, Rung&, const FitOptions&)>& fit) {
  FitOptions one = contest.options;
  one.threads = 1;
  data::in_parallel(rungs.size(), contest.options.threads,
                    [&](std::size_t i) { fit(i, *rungs[i], options_for(*rungs[i], one)); });
}

Rung& add_searched(const Contest& contest, const Terms& terms, Rungs& rungs,
                   const FirstPart& first_part) {
  Rung& rung = rungs.emplace_back(rung_with(contest.ladder, terms));
  rung.first_part = first_part;
  fit_rung(contest.tracks, nullptr, nullptr, options_for(rung, contest.options), rung);
  return rung;
}

void fit_or_better(const Contest& contest, const Rung& known, const FitOptions& options, Rung& rung,
                   const Nearby& near) {
  Rung again = rung_with(contest.ladder, rung.terms);
  again.fitted_anew = rung.fitted_anew;
  again.in_vain = rung.in_vain;
  fit_neighbour(contest.tracks, known, options, again, near);
  if (!rung.fitted || again.bic < rung.bic) rung = std::move(again);
}

bool is_open(const Neighbour& neighbour, const Rung& known, Rungs& rungs) {
  const Rung* const before = known_rung(rungs, neighbour.terms);
  return before == nullptr || ended_astray(*before, known, neighbour.near);
}

std::vector<const Rung*> add_neighbours(const Contest& contest, std::span<const Neighbour> wanted,
                                        const Rung& known, Rungs& rungs) {
  std::vector<Rung*> open;
  std::vector<const Nearby*> near;
  for (const Neighbour& neighbour : wanted) {
    if (!is_open(neighbour, known, rungs)) continue;
    Rung* rung = known_rung(rungs, neighbour.terms);
    if (rung != nullptr)
      rung->fitted_anew = true;
    else
      rung = &blank_rung(contest.ladder, neighbour.terms, rungs);
    open.push_back(rung);
    near.push_back(&neighbour.near);
  }
  side_by_side(contest, open, [&](std::size_t i, Rung& rung, const FitOptions& options) {
    fit_or_better(contest, known, options, rung, *near[i]);
  });
  return {open.begin(), open.end()};
}

Rung* known_rung(Rungs& rungs, const Terms& terms) {
  return rung_of(rungs, terms, false);
}

bool is_known(const Rungs& rungs, const Terms& terms) {
  return std::any_of(rungs.begin(), rungs.end(),
                     [&](const Rung& rung) { return rung.terms == terms && !rung.by_score_test; });
}

void add_score_tested(Rung tested, Rungs& rungs) {
  if (is_known(rungs, tested.terms)) return;
  Rung* const before = rung_of(rungs, tested.terms, true);
  if (before == nullptr)
    rungs.push_back(std::move(tested));
  else if (tested.bic < before->bic)
    *before = std::move(tested);
}

Nearby nearby(const ScoreTest& test, const ScoreTest::Change& change) {
  return {change.values, change.chi2 - test.before};
}

const Rung* least_bic(const Rungs& rungs) {
  const Rung* best = nullptr;
  for (const Rung& rung : rungs)
    if (rung.fitted && (best == nullptr || rung.bic < best->bic)) best = &rung;
  return best;
}

const Rung* simplest_sufficient(const Ladder& ladder, const Rungs& rungs) {
  const auto unusual = [&](const Rung& rung) {
    return std::count_if(rung.terms.begin(), rung.terms.end(), [&](int index) {
      const Term& term = ladder.terms[static_cast<std::size_t>(index)];
      return !term.usual && !term.last_resort;
    });
  };
  const Rung* best = least_bic(rungs);
  const double allowed = best != nullptr ? best->bic + kStrong : 0.0;
  for (const Rung& rung : rungs)
    if (rung.fitted && rung.bic <= allowed &&
        std::tuple(rung.parameters, unusual(rung), rung.bic) <
            std::tuple(best->parameters, unusual(*best), best->bic))
      best = &rung;
  return best;
}

bool searched_in_vain(const Rungs& rungs) {
  return std::any_of(rungs.begin(), rungs.end(), [](const Rung& rung) { return rung.in_vain; });
}

double most_evidence_against(const Rung& known) {
  return known.fit.model == "sliding" ? kStrong : kVeryStrong;
}

}  // namespace trochoid::fitting
