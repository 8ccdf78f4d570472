#include "choose/exchange.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <utility>

#include "choose/terms.hpp"

namespace trochoid::fitting {
namespace {

// What a change costs in BIC for its parameters, and is expected to bring in chi-square.
double price(const ScoreTest& test, const ScoreTest::Change& change) {
  return change.parameters * std::log(test.rows);
}
double gain(const ScoreTest& test, const ScoreTest::Change& change) {
  return test.before - change.chi2;
}

// Whether a further term, however little speaks for it, widens the error bars noticeably by what it
// moves other parameters by, as it is weighed there (rivals.cpp).
bool counts_in_error_bars(const ScoreTest::Change& change, double gained) {
  constexpr double kNoticeably = 1.3;
  const double odds = std::exp(0.5 * gained - change.parameters);  // after AIC
  const double variance = odds / (1.0 + odds) * change.moves * change.moves;
  return 1.0 + variance > kNoticeably * kNoticeably;
}

// Whether a score-tested change of a known rung may come to something. One that hardly follows the
// track has to be mended for a good part. Where what is left hangs together, a further term may be
// what is missing, and all that it takes away counts; no other does, as in the error bars
// (rivals.cpp). What takes the place of another, or stands beside a rung that leaves next to
// nothing but noise, may do as well as that. So may what differs by more terms, but of that only
// what is expected to do as well.
bool worth_a_fit(const Rung& known, double inflation, const ScoreTest& test,
                 const ScoreTest::Change& change, const Difference& by) {
  const double gained = gain(test, change), paid = price(test, change);
  if (leaves_much(known)) return gained > kGoodPart * test.before;
  if (by.larger() && known.fit.whiteness_p < kWhite && gained > paid) return true;
  if (by.larger() && !leaves_independent(known, inflation)) return false;
  if (by.larger() && counts_in_error_bars(change, gained / inflation)) return true;
  const double against = paid - gained / inflation;
  if (by.larger()) return against < most_evidence_against(known);
  if (by.exchanged()) return against < kVeryStrong;
  return against < kStrong;
}

// Whether one of a set's subsets is expected to do as well as the set.
bool has_idle_terms(const std::map<int, Terms>& sets, int key,
                    const std::function<double(int)>& expected_bic) {
  return std::any_of(sets.begin(), sets.end(), [&](const auto& other) {
    return other.first != key && (other.first & key) == other.first &&
           expected_bic(other.first) <= expected_bic(key);
  });
}

// Whether a further loss need not be fitted to know what it comes to. Where a body slides that is
// dear.
bool gains_nothing(const Rung& known, double inflation, double gained, int parameters,
                   const Difference& by) {
  constexpr double kByChance = 1.0;  // what a parameter gains of chi-square
  return by.larger() && known.fit.model == "sliding" && leaves_independent(known, inflation) &&
         gained < kByChance * parameters;
}

// What a known rung's tangent plane says of these sets of terms; the last one holds all the others.
std::optional<ScoreTest> test_of(const Contest& contest, const Rung& known,
                                 const std::map<int, Terms>& sets) {
  const Terms& all = sets.rbegin()->second;
  std::map<int, std::set<std::string>> absent;
  for (const auto& [key, terms] : sets)
    absent[key] = parameters_without(contest.ladder, all, terms);
  return score_test(contest.tracks, known, contest.options, rung_with(contest.ladder, all), absent);
}

Rung score_tested(const Contest& contest, const Rung& known, const Terms& terms,
                  const ScoreTest& test, const ScoreTest::Change& change, double inflation) {
  Rung rung = rung_with(contest.ladder, terms);
  take_from_score_test(known, test, change, inflation, rung);
  return rung;
}

// Sets of terms beside a known rung's that may do as well, the likeliest first: one term more,
// one in the place of another, and, of those that differ by more, a few. Those that gain too little
// by the score test are added to the rungs as it has them.
std::vector<Neighbour> worth_exchanging(const Contest& contest, const Rung& known, Rungs& rungs) {
  constexpr std::size_t kMostFar = 4;
  const Ladder& ladder = contest.ladder;
  const std::map<int, Terms> sets = all_sets(ladder, known.terms);
  const auto test = test_of(contest, known, sets);
  std::vector<Neighbour> worth;
  if (!test) {
    for (Terms& terms : with_one_more(ladder, known.terms)) worth.push_back({std::move(terms)});
    return worth;
  }
  const double inflation = variance_inflation(contest.tracks, known, contest.options);
  const auto change = [&](int key) -> const ScoreTest::Change& { return test->instead.at(key); };
  const auto bic = [&](int key) {  // beside the known one's
    return price(*test, change(key)) - gain(*test, change(key));
  };
  std::vector<int> order;
  for (const auto& [key, terms] : sets) order.push_back(key);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return bic(a) < bic(b); });
  std::size_t far = 0;
  for (const int key : order) {
    const Terms& terms = sets.at(key);
    const Difference by = difference(terms, known.terms);
    Neighbour neighbour{terms, nearby(*test, change(key))};
    if (!is_open(neighbour, known, rungs) || !worth_a_fit(known, inflation, *test, change(key), by))
      continue;
    const bool near = by.larger() || by.exchanged();
    if (!near && (far >= kMostFar || has_idle_terms(sets, key, bic))) continue;
    const double gained = gain(*test, change(key)) / inflation;
    if (gains_nothing(known, inflation, gained, change(key).parameters, by)) {
      add_score_tested(score_tested(contest, known, terms, *test, change(key), inflation), rungs);
      continue;
    }
    far += near ? 0 : 1;
    worth.push_back(std::move(neighbour));
  }
  return worth;
}

// Rungs that follow the same law as a known one and ended above it: nothing is learned of their
// terms there.
std::vector<Rung*> stuck_above(const Rung& known, Rungs& rungs) {
  std::vector<Rung*> stuck;
  for (Rung& rung : rungs)
    if (rung.terms != known.terms && rung.fitted && !rung.by_score_test && !rung.fitted_anew &&
        rung.fit.model == known.fit.model && has_all_terms_of(rung, known) &&
        ended_above(rung, known))
      stuck.push_back(&rung);
  return stuck;
}

// Fits what is stuck above a known rung anew, from there, once.
void fit_stuck_anew(const Contest& contest, const Rung& known, Rungs& rungs) {
  if (!explains(known) || known.fit.arcs.size() != 1) return;
  side_by_side(contest, stuck_above(known, rungs),
               [&](std::size_t, Rung& rung, const FitOptions& options) {
                 rung.fitted_anew = true;
                 fit_or_better(contest, known, options, rung);
               });
}

// Adds what may do as well as a known rung beside it. @returns the rung to go on from.
const Rung* exchange_terms(const Contest& contest, const Rung& known, Rungs& rungs) {
  constexpr std::size_t kFirst = 2;
  fit_stuck_anew(contest, known, rungs);
  const std::vector<Neighbour> worth = worth_exchanging(contest, known, rungs);
  std::span<const Neighbour> open = worth;
  // Where something is missing, the likeliest leads on, and changes what the others gain.
  if (known.fit.whiteness_p < kWhite && open.size() > kFirst) {
    add_neighbours(contest, open.first(kFirst), known, rungs);
    const Rung* best = simplest_sufficient(contest.ladder, rungs);
    if (best->fit.converged && best->bic < known.bic - kVeryStrong) return best;
    open = open.subspan(kFirst);
  }
  add_neighbours(contest, open, known, rungs);
  return simplest_sufficient(contest.ladder, rungs);
}

// The likeliest rung from which no exchange has been made yet, of those whose evidence is as good
// as the chosen one's, if there is one: two losses together may stand for two others, with none of
// which alone they are exchanged. Those of a sliding body are dear.
const Rung* as_good(const Rungs& rungs, const Rung& chosen,
                    const std::set<const Rung*>& exchanged) {
  const Rung* best = nullptr;
  if (chosen.fit.model == "sliding") return best;
  for (const Rung& rung : rungs)
    if (rung.fitted && rung.fit.converged && !rung.by_score_test && !exchanged.contains(&rung) &&
        rung.bic < chosen.bic + kBareMention && (best == nullptr || rung.bic < best->bic))
      best = &rung;
  return best;
}

}  // namespace

const Rung* exchange_while_worth(const Contest& contest, Rungs& rungs) {
  constexpr std::size_t kMostRounds = 6;
  const Rung* chosen = simplest_sufficient(contest.ladder, rungs);
  std::set<const Rung*> exchanged;
  for (std::size_t round = 0; round < kMostRounds && chosen != nullptr && chosen->fit.converged;
       ++round) {
    // A term found that way asks for the others anew, unless even then the model lacks something.
    if (round > 0 && chosen->fit.verdict == data::FitVerdict::unexplained) break;
    const Rung* from = exchanged.contains(chosen) ? as_good(rungs, *chosen, exchanged) : chosen;
    if (from == nullptr) break;
    exchanged.insert(from);
    chosen = exchange_terms(contest, *from, rungs);
  }
  return chosen;
}

void add_usual_losses(const Contest& contest, const Rung& chosen, Rungs& rungs) {
  const Ladder& ladder = contest.ladder;
  if (!chosen.fit.converged || chosen.fit.whiteness_p >= kWhite ||
      parameters_of_losses(ladder, chosen.terms).empty())
    return;
  std::map<int, Terms> sets = with_usual_losses(ladder, chosen.terms);
  // Where [fit] says what one of them is, the chosen rung without it is at no minimum of a model
  // with it. Of the sets that are left one still holds all the others.
  std::erase_if(sets, [&](const auto& item) {
    return says_something_of(ladder.plain.fit,
                             parameters_without(ladder, item.second, chosen.terms));
  });
  if (sets.empty()) return;
  const auto test = test_of(contest, chosen, sets);
  if (!test) return;
  const double inflation = variance_inflation(contest.tracks, chosen, contest.options);
  for (const auto& [key, terms] : sets)
    if (!is_known(rungs, terms))
      add_score_tested(
          score_tested(contest, chosen, terms, *test, test->instead.at(key), inflation), rungs);
}

}  // namespace trochoid::fitting
