#include "choose/leave_out.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "choose/terms.hpp"
#include "judge/first_guess.hpp"
#include "problem/problem.hpp"

namespace trochoid::fitting {
namespace {

// Whether a rung's losses that a smaller one lacks may be zero, by error bars so many times as
// wide.
bool may_do_without(const Rung& rung, const data::Fit& fit, const Rung& smaller, double times) {
  constexpr double kSurelyThere_sigmas = 4.0;  // which curvature may misjudge
  std::set<std::string> lost = parameters_of(rung.scene);
  for (const std::string& name : parameters_of(smaller.scene)) lost.erase(name);
  lost.erase(kSlipScale);  // the smaller one's is fitted anew
  return std::all_of(lost.begin(), lost.end(), [&](const std::string& name) {
    const data::FitParameter* loss = fit.find(name);
    return loss != nullptr && std::abs(loss->value) < kSurelyThere_sigmas * times * loss->sigma;
  });
}

// The same by full error bars, which are only made where those by curvature do not decide it: they
// are wider, though hardly ever so many times.
bool may_do_without(const Rung& rung, const Rung& smaller) {
  constexpr double kWider = 10.0;
  if (may_do_without(rung, rung.fit, smaller, 1.0)) return true;
  return may_do_without(rung, rung.fit, smaller, kWider) &&
         may_do_without(rung, with_full_bars(rung), smaller, 1.0);
}

// Sets with one term less than a rung's that may do as well.
std::vector<Neighbour> may_suffice(const Contest& contest, const Rung& rung) {
  std::map<int, std::set<std::string>> absent;  // by the term that is left out
  for (const int term : rung.terms) {
    Terms fewer = rung.terms;
    fewer.erase(term);
    if (may_go(contest.ladder, rung.terms, term) &&
        may_do_without(rung, rung_with(contest.ladder, fewer)))
      absent[term] = parameters_without(contest.ladder, rung.terms, fewer);
  }
  if (absent.empty()) return {};
  const auto test = score_test(contest.tracks, rung, contest.options, rung, absent);
  std::vector<Neighbour> smaller;
  for (const auto& [term, parameters] : absent) {
    smaller.push_back({rung.terms});
    smaller.back().terms.erase(term);
    if (test) smaller.back().near = nearby(*test, test->instead.at(term));
  }
  return smaller;
}

}  // namespace

void step_down(const Contest& contest, const Rung& from, Rungs& rungs) {
  const Rung* current = &from;
  while (current->fitted && current->fit.converged) {
    const std::vector<Neighbour> smaller = may_suffice(contest, *current);
    if (smaller.empty()) return;
    const Rung* best = nullptr;
    for (const Rung* rung : add_neighbours(contest, smaller, *current, rungs))
      if (rung->fitted && rung->fit.converged && rung->bic < current->bic + kStrong &&
          (best == nullptr || rung->bic < best->bic))
        best = rung;
    if (best == nullptr) return;
    current = best;
  }
}

void let_go_of_friction(const Contest& contest, Rungs& rungs) {
  constexpr double kSurelyThere_sigmas = 4.0;
  constexpr double kNoFriction = 1e-3;  // a hundredth of what the slipperiest floors have
  const std::optional<int> smooth = smooth_term(contest.ladder);
  const Rung* best = simplest_sufficient(contest.ladder, rungs);
  if (!smooth || best == nullptr || !best->fit.converged || best->fit.model != "sliding") return;
  const data::Fit full = with_full_bars(*best);
  const data::FitParameter* friction = full.find("friction");
  if (friction == nullptr || friction->value > kSurelyThere_sigmas * friction->sigma + kNoFriction)
    return;
  Terms terms = best->terms;
  std::erase_if(terms, [&](int index) {
    return contest.ladder.terms[static_cast<std::size_t>(index)].last_resort;
  });
  terms.insert(*smooth);
  const Neighbour none{terms};
  add_neighbours(contest, std::span(&none, 1), *best, rungs);
  step_down(contest,
            *std::find_if(rungs.begin(), rungs.end(),
                          [&](const Rung& rung) { return rung.terms == terms; }),
            rungs);
}

}  // namespace trochoid::fitting
