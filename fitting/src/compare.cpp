#include "trochoid/fitting/compare.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <tuple>

#include "adequacy.hpp"
#include "first_guess.hpp"
#include "ladder.hpp"
#include "problem.hpp"
#include "rung.hpp"
#include "rung_words.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/fitting/parallel.hpp"

namespace trochoid::fitting {
namespace {

constexpr std::size_t kMostTerms = 3, kMostRounds = 6;
constexpr double kNoFriction = 1e-3;  // a hundredth of what the slipperiest floors have

const Rung* least_bic(const std::vector<Rung>& rungs) {
  const Rung* best = nullptr;
  for (const Rung& rung : rungs)
    if (rung.fitted && (best == nullptr || rung.bic < best->bic)) best = &rung;
  return best;
}

// Fewest parameters among those as good as the best; among these the fewest unusual terms, and then
// the least BIC.
const Rung* simplest_sufficient(const Ladder& ladder, const std::vector<Rung>& rungs) {
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

std::string name_of(const Ladder& ladder, const std::set<int>& terms) {
  std::string name = ladder.law, added;
  for (const int index : terms) {
    const Term& term = ladder.terms[static_cast<std::size_t>(index)];
    if (term.smooth)
      name = "smooth floor";
    else
      added += " + " + term.name;
  }
  return name + added;
}

// Whether [fit] may call one of these parameters so; a group's name covers its components.
bool names_one_of(const std::set<std::string>& parameters, const std::string& name) {
  return std::any_of(parameters.begin(), parameters.end(), [&](const std::string& parameter) {
    return parameter == name || parameter.starts_with(name + "[");
  });
}

// What [fit] says of parameters that a rung does not have is meant for other rungs.
void keep_own(data::Scene& scene) {
  data::FitSettings& fit = scene.fit;
  if (fit.free.empty() && fit.fixed.empty() && fit.bounds.empty()) return;
  const std::set<std::string> own = parameters_of(scene);
  std::erase_if(fit.free, [&](const std::string& name) { return !names_one_of(own, name); });
  std::erase_if(fit.fixed, [&](const auto& item) { return !names_one_of(own, item.first); });
  std::erase_if(fit.bounds, [&](const auto& item) { return !names_one_of(own, item.first); });
}

// Every rung frees the terms it has: a list made for one of them would hold the others' fixed.
void free_all_terms(data::FitSettings& fit) {
  std::erase_if(fit.free, [](const std::string& name) { return !leaves_choice(name); });
}

Rung rung_with(const Ladder& ladder, const std::set<int>& terms) {
  Rung rung;
  rung.terms = terms;
  rung.name = name_of(ladder, terms);
  rung.scene = ladder.plain;
  for (const int term : terms) ladder.terms[static_cast<std::size_t>(term)].switch_on(rung.scene);
  keep_own(rung.scene);
  return rung;
}

// Index of the term that is a floor without friction, if the ladder has it.
std::optional<int> smooth_term(const Ladder& ladder) {
  for (int index = 0; index < static_cast<int>(ladder.terms.size()); ++index)
    if (ladder.terms[static_cast<std::size_t>(index)].smooth) return index;
  return std::nullopt;
}

// For one of several rungs that are fitted side by side; what is said of it names it.
FitOptions options_for(const Rung& rung, const FitOptions& options) {
  FitOptions own = options;
  const auto named = [name = rung.name](const auto& say) {
    return [name, say](const std::string& words) { say(fmt::format("{}: {}", name, words)); };
  };
  if (options.progress) own.progress = named(options.progress);
  if (options.log) own.log = named(options.log);
  return own;
}

// Whether a term stands for something beside these.
bool means_something(const Ladder& ladder, const std::set<int>& terms, int index) {
  const std::optional<int> of = ladder.terms[static_cast<std::size_t>(index)].of;
  return !of || terms.contains(*of);
}

// Whether one of these terms may be left out: the last resort stays, and what another is a property
// of.
bool may_go(const Ladder& ladder, const std::set<int>& terms, int index) {
  return !ladder.terms[static_cast<std::size_t>(index)].last_resort &&
         std::all_of(terms.begin(), terms.end(), [&](int other) {
           return ladder.terms[static_cast<std::size_t>(other)].of != index;
         });
}

// All extensions of rungs[current] by one term, tried at the same time. @returns the index of the
// best rung now known.
std::size_t step_up(const Ladder& ladder, std::span<const data::Track> tracks,
                    const FitOptions& options, bool last_resort, Reach reach, std::size_t current,
                    std::vector<Rung>& rungs) {
  const std::size_t first = rungs.size();
  std::vector<const Term*> added;
  for (int index = 0; index < static_cast<int>(ladder.terms.size()); ++index) {
    const Term& term = ladder.terms[static_cast<std::size_t>(index)];
    std::set<int> terms = rungs[current].terms;
    if (term.last_resort != last_resort || term.smooth || !means_something(ladder, terms, index) ||
        !terms.insert(index).second)
      continue;
    rungs.push_back(rung_with(ladder, terms));
    added.push_back(&term);
  }
  FitOptions one = options;
  one.threads = 1;
  in_parallel(static_cast<int>(added.size()), options.threads, [&](int i) {
    const auto n = static_cast<std::size_t>(i);
    Rung& rung = rungs[first + n];
    fit_rung(tracks, &rungs[current], added[n], options_for(rung, one), rung, reach);
  });
  std::size_t best = current;
  for (std::size_t i = first; i < rungs.size(); ++i)
    if (rungs[i].fitted && (!rungs[best].fitted || rungs[i].bic < rungs[best].bic)) best = i;
  return best;
}

// What usually acts on a body that rolls.
std::set<int> usual_losses(const Ladder& ladder) {
  std::set<int> terms;
  for (int index = 0; index < static_cast<int>(ladder.terms.size()); ++index)
    if (ladder.terms[static_cast<std::size_t>(index)].usual) terms.insert(index);
  return terms;
}

// The terms and the last resort; empty where there is none.
std::set<int> with_last_resort(const Ladder& ladder, std::set<int> terms) {
  bool resort = false;
  for (int index = 0; index < static_cast<int>(ladder.terms.size()); ++index) {
    const Term& term = ladder.terms[static_cast<std::size_t>(index)];
    if (!term.last_resort || term.smooth) continue;
    resort = true;
    terms.insert(index);
  }
  return resort ? terms : std::set<int>{};
}

// The last resort together with the usual losses: a body that slides without any may not even stay
// on the floor as long as the track. Empty where there is no last resort.
std::set<int> all_that_usually_acts(const Ladder& ladder, std::set<int> terms) {
  terms.merge(usual_losses(ladder));
  return with_last_resort(ladder, std::move(terms));
}

// A set of terms beside a known rung's, and where its minimum is expected.
struct Neighbour {
  std::set<int> terms;
  Nearby near = {};
};

bool is_known(const std::vector<Rung>& rungs, const std::set<int>& terms) {
  return std::any_of(rungs.begin(), rungs.end(),
                     [&](const Rung& rung) { return rung.terms == terms; });
}

// Fits the rungs with these sets of terms that are not known yet, side by side, from the solution
// of rungs[known].
void add_neighbours(const Ladder& ladder, std::span<const data::Track> tracks,
                    const FitOptions& options, std::span<const Neighbour> wanted, std::size_t known,
                    std::vector<Rung>& rungs) {
  const std::size_t first = rungs.size();
  std::vector<const Nearby*> near;
  for (const Neighbour& neighbour : wanted) {
    if (is_known(rungs, neighbour.terms)) continue;
    rungs.push_back(rung_with(ladder, neighbour.terms));
    near.push_back(&neighbour.near);
  }
  FitOptions one = options;
  one.threads = 1;
  in_parallel(static_cast<int>(near.size()), options.threads, [&](int i) {
    const auto n = static_cast<std::size_t>(i);
    Rung& rung = rungs[first + n];
    fit_neighbour(tracks, rungs[known], options_for(rung, one), rung, *near[n]);
  });
}

// What a promise lets expect of one of its changes.
Nearby nearby(const Promise& promise, const Promise::Change& change) {
  return {change.values, change.chi2 - promise.before};
}

// The terms with one more; the last resort is not added.
std::vector<std::set<int>> with_one_more(const Ladder& ladder, const std::set<int>& terms) {
  std::vector<std::set<int>> sets;
  for (int index = 0; index < static_cast<int>(ladder.terms.size()); ++index) {
    if (terms.contains(index) || !means_something(ladder, terms, index) ||
        ladder.terms[static_cast<std::size_t>(index)].last_resort)
      continue;
    sets.push_back(terms);
    sets.back().insert(index);
  }
  return sets;
}

// Whether a rung's losses that a smaller one lacks may be zero, by error bars so many times as
// wide.
bool may_do_without(const Rung& rung, const data::Fit& fit, const Rung& smaller, double times) {
  constexpr double kSurely = 4.0;  // sigmas, which curvature may misjudge
  std::set<std::string> lost = parameters_of(rung.scene);
  for (const std::string& name : parameters_of(smaller.scene)) lost.erase(name);
  lost.erase(kSlipScale);  // the smaller one's is fitted anew
  return std::all_of(lost.begin(), lost.end(), [&](const std::string& name) {
    const data::FitParameter* loss = fit.find(name);
    return loss != nullptr && std::abs(loss->value) < kSurely * times * loss->sigma;
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

// Parameters that a rung has and one with fewer terms has not.
std::set<std::string> parameters_without(const Ladder& ladder, const std::set<int>& terms,
                                         const std::set<int>& fewer) {
  std::set<std::string> own = parameters_of(rung_with(ladder, terms).scene);
  for (const std::string& name : parameters_of(rung_with(ladder, fewer).scene)) own.erase(name);
  return own;
}

// Sets with one term less than a rung's that may do as well.
std::vector<Neighbour> may_suffice(const Ladder& ladder, std::span<const data::Track> tracks,
                                   const FitOptions& options, const Rung& rung) {
  std::map<int, std::set<std::string>> absent;  // by the term that is left out
  for (const int term : rung.terms) {
    std::set<int> fewer = rung.terms;
    fewer.erase(term);
    if (may_go(ladder, rung.terms, term) && may_do_without(rung, rung_with(ladder, fewer)))
      absent[term] = parameters_without(ladder, rung.terms, fewer);
  }
  if (absent.empty()) return {};
  const auto promise = promised(tracks, rung, options, rung, absent);
  std::vector<Neighbour> smaller;
  for (const auto& [term, parameters] : absent) {
    smaller.push_back({rung.terms});
    smaller.back().terms.erase(term);
    if (promise) smaller.back().near = nearby(*promise, promise->instead.at(term));
  }
  return smaller;
}

// Everything but the last resort was added before it was known what that explains: terms the data
// do not need any more are left out again, one at a time, as long as that costs no strong evidence;
// those whose error bars say that it would are not tried.
void step_down(const Ladder& ladder, std::span<const data::Track> tracks, const FitOptions& options,
               std::size_t current, std::vector<Rung>& rungs) {
  while (rungs[current].fitted && rungs[current].fit.converged) {
    const std::size_t first = rungs.size();
    const std::set<int> terms = rungs[current].terms;
    const std::vector<Neighbour> smaller = may_suffice(ladder, tracks, options, rungs[current]);
    if (smaller.empty()) return;
    add_neighbours(ladder, tracks, options, smaller, current, rungs);
    std::size_t best = current;
    for (std::size_t i = first; i < rungs.size(); ++i)
      if (rungs[i].fitted && rungs[i].fit.converged &&
          rungs[i].bic < rungs[current].bic + kStrong &&
          (best == current || rungs[i].bic < rungs[best].bic))
        best = i;
    if (best == current) return;
    current = best;
  }
}

// What a change is promised to cost in BIC for its parameters, and to bring in chi-square.
double price(const Promise& promise, const Promise::Change& change) {
  return change.parameters * std::log(promise.rows);
}
double gain(const Promise& promise, const Promise::Change& change) {
  return promise.before - change.chi2;
}

// Up to which evidence against it a rung is worth telling of beside another. Those of a sliding
// body are dear: only what counts in the error bars.
double most_evidence_against(const Rung& known) {
  return known.fit.model == "sliding" ? kStrong : kVeryStrong;
}

// Whether a further term, however little speaks for it, widens the error bars noticeably by what it
// moves other parameters by, as it is weighed there (rivals.cpp).
bool counts_in_error_bars(const Promise::Change& change, double gained) {
  constexpr double kNoticeably = 1.3;
  const double odds = std::exp(0.5 * gained - change.parameters);  // after AIC
  const double variance = odds / (1.0 + odds) * change.moves * change.moves;
  return 1.0 + variance > kNoticeably * kNoticeably;
}

// How a set of terms differs from a known rung's.
struct Difference {
  std::size_t added = 0, removed = 0;
  [[nodiscard]] bool larger() const { return added == 1 && removed == 0; }
  [[nodiscard]] bool exchanged() const { return added == 1 && removed == 1; }
};
Difference difference(const std::set<int>& terms, const std::set<int>& known) {
  const auto count_of = [](const std::set<int>& these, const std::set<int>& others) {
    return static_cast<std::size_t>(std::count_if(
        these.begin(), these.end(), [&](int term) { return !others.contains(term); }));
  };
  return {count_of(terms, known), count_of(known, terms)};
}

// Whether a promised change of a known rung may come to something. One that hardly follows the
// track has to be mended for a good part: all else would only follow the tracker's errors. Where
// what is left hangs together, a further term may be what is missing, and all that it takes away
// counts; what takes the place of another, or stands beside a rung that leaves noise, may do as
// well as that. So may what differs by more terms, but of that only what promises to do as well.
bool worth_a_fit(const Rung& known, double dilution, const Promise& promise,
                 const Promise::Change& change, const Difference& by) {
  constexpr double kGoodPart = 0.25;
  const double gained = gain(promise, change), paid = price(promise, change);
  if (known.fit.verdict == "doubtful" || known.fit.verdict == "unexplained")
    return gained > kGoodPart * promise.before;
  if (by.larger() && known.fit.whiteness_p < kWhite) return gained > paid;
  if (by.larger() && counts_in_error_bars(change, gained / dilution)) return true;
  const double against = paid - gained / dilution;
  if (by.larger()) return against < most_evidence_against(known);
  if (by.exchanged()) return against < kVeryStrong;
  return against < kStrong;
}

// All sets of terms, beside the last resort that a known rung has, that mean something, by a key of
// their own.
std::map<int, std::set<int>> all_sets(const Ladder& ladder, const std::set<int>& known) {
  std::vector<int> open;
  for (int index = 0; index < static_cast<int>(ladder.terms.size()); ++index)
    if (!ladder.terms[static_cast<std::size_t>(index)].last_resort) open.push_back(index);
  std::map<int, std::set<int>> sets;
  for (int key = 0; key < 1 << open.size(); ++key) {
    std::set<int> terms = known;
    for (std::size_t bit = 0; bit < open.size(); ++bit)
      if ((key >> bit & 1) != 0)
        terms.insert(open[bit]);
      else
        terms.erase(open[bit]);
    if (std::all_of(terms.begin(), terms.end(),
                    [&](int term) { return means_something(ladder, terms, term); }))
      sets[key] = std::move(terms);
  }
  return sets;
}

// Whether what a set promises one of its subsets promises as well.
bool has_idle_terms(const std::map<int, std::set<int>>& sets, int key,
                    const std::function<double(int)>& promised_bic) {
  return std::any_of(sets.begin(), sets.end(), [&](const auto& other) {
    return other.first != key && (other.first & key) == other.first &&
           promised_bic(other.first) <= promised_bic(key);
  });
}

// Whether a further loss need not be fitted to know what it comes to. Where a body slides that is
// dear.
bool promises_nothing(const Rung& known, double gained, int parameters, const Difference& by) {
  constexpr double kByChance = 1.0;  // what a parameter gains of chi-square
  return by.larger() && known.fit.model == "sliding" && known.fit.whiteness_p >= kWhite &&
         gained < kByChance * parameters;
}

// Sets of terms beside a known rung's that may do as well, the most promising first: one term more,
// one in the place of another, and, of those that differ by more, a few. Those that promise nothing
// are added to the rungs as they are promised.
std::vector<Neighbour> worth_exchanging(const Ladder& ladder, std::span<const data::Track> tracks,
                                        const FitOptions& options, const Rung& known,
                                        std::vector<Rung>& rungs) {
  constexpr std::size_t kMostFar = 4;
  const std::map<int, std::set<int>> sets = all_sets(ladder, known.terms);
  const std::set<int>& all = sets.rbegin()->second;
  std::map<int, std::set<std::string>> absent;
  for (const auto& [key, terms] : sets) absent[key] = parameters_without(ladder, all, terms);
  const auto promise = promised(tracks, known, options, rung_with(ladder, all), absent);
  std::vector<Neighbour> worth;
  if (!promise) {
    for (std::set<int>& terms : with_one_more(ladder, known.terms))
      worth.push_back({std::move(terms)});
    return worth;
  }
  const double diluted = dilution(tracks, known, options);
  const auto change = [&](int key) -> const Promise::Change& { return promise->instead.at(key); };
  const auto bic = [&](int key) {  // beside the known one's
    return price(*promise, change(key)) - gain(*promise, change(key));
  };
  std::vector<int> order;
  for (const auto& [key, terms] : sets) order.push_back(key);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return bic(a) < bic(b); });
  std::size_t far = 0;
  for (const int key : order) {
    const std::set<int>& terms = sets.at(key);
    const Difference by = difference(terms, known.terms);
    if (terms == known.terms || !worth_a_fit(known, diluted, *promise, change(key), by)) continue;
    const bool near = by.larger() || by.exchanged();
    if (!near && (far >= kMostFar || has_idle_terms(sets, key, bic))) continue;
    const double gained = gain(*promise, change(key)) / diluted;
    if (promises_nothing(known, gained, change(key).parameters, by)) {
      if (is_known(rungs, terms)) continue;
      rungs.push_back(rung_with(ladder, terms));
      take_as_promised(known, *promise, change(key), diluted, rungs.back());
      continue;
    }
    far += near ? 0 : 1;
    worth.push_back({terms, nearby(*promise, change(key))});
  }
  return worth;
}

// Terms are added one at a time, by what is gained at once, and those of a last resort all
// together: what never stood beside the others may do as well as one of them. @returns the rung to
// go on from.
const Rung* exchange_terms(const Ladder& ladder, std::span<const data::Track> tracks,
                           const FitOptions& options, const Rung& known, std::vector<Rung>& rungs) {
  constexpr std::size_t kFirst = 2;
  const auto index = static_cast<std::size_t>(&known - rungs.data());
  const std::vector<Neighbour> worth = worth_exchanging(ladder, tracks, options, known, rungs);
  // Where something is missing, what promises most leads on, and changes what the others promise.
  if (known.fit.whiteness_p < kWhite && worth.size() > kFirst) {
    add_neighbours(ladder, tracks, options, std::span(worth).first(kFirst), index, rungs);
    const Rung* best = simplest_sufficient(ladder, rungs);
    if (best->fit.converged && best->bic < known.bic - kVeryStrong) return best;
  }
  add_neighbours(ladder, tracks, options, worth, index, rungs);
  return simplest_sufficient(ladder, rungs);
}

// A friction that may be nothing is none: the same losses on a smooth floor, and fewer of them,
// beside a rung that slides.
void let_go_of_friction(const Ladder& ladder, std::span<const data::Track> tracks,
                        const FitOptions& options, std::vector<Rung>& rungs) {
  constexpr double kSurely = 4.0;  // sigmas
  const std::optional<int> smooth = smooth_term(ladder);
  const Rung* best = simplest_sufficient(ladder, rungs);
  if (!smooth || best == nullptr || !best->fit.converged || best->fit.model != "sliding") return;
  const data::Fit full = with_full_bars(*best);
  const data::FitParameter* friction = full.find("friction");
  if (friction == nullptr || friction->value > kSurely * friction->sigma + kNoFriction) return;
  std::set<int> terms = best->terms;
  std::erase_if(
      terms, [&](int index) { return ladder.terms[static_cast<std::size_t>(index)].last_resort; });
  terms.insert(*smooth);
  const Neighbour none{terms};
  add_neighbours(ladder, tracks, options, std::span(&none, 1),
                 static_cast<std::size_t>(best - rungs.data()), rungs);
  const auto added = std::find_if(rungs.begin(), rungs.end(),
                                  [&](const Rung& rung) { return rung.terms == terms; });
  step_down(ladder, tracks, options, static_cast<std::size_t>(added - rungs.begin()), rungs);
}

// One more term at a time, from rungs[current] on, while each is worth it. @returns the last one's
// index.
std::size_t step_up_while_worth(const Ladder& ladder, std::span<const data::Track> tracks,
                                const FitOptions& options, Reach reach, std::size_t current,
                                std::vector<Rung>& rungs) {
  if (reach == Reach::from_below && !rungs[current].fitted)
    return current;  // nothing to go on from
  for (std::size_t size = 1; size <= std::min(kMostTerms, ladder.terms.size()); ++size) {
    const std::size_t best = step_up(ladder, tracks, options, false, reach, current, rungs);
    const bool worth = best != current && rungs[best].bic < rungs[current].bic - kStrong;
    if (!worth) break;
    current = best;
  }
  return current;
}

// A rung that explains the track where `known` does not, with another law for one of its losses.
std::optional<Rung> by_another_law(const Ladder& ladder, std::span<const data::Track> tracks,
                                   const FitOptions& options, const Rung& known) {
  std::vector<Rung> tried;
  std::vector<const Term*> added;
  for (int index = 0; index < static_cast<int>(ladder.terms.size()); ++index) {
    const Term& term = ladder.terms[static_cast<std::size_t>(index)];
    if (!term.instead_of || !known.terms.contains(*term.instead_of)) continue;
    std::set<int> terms = known.terms;
    terms.erase(*term.instead_of);
    terms.insert(index);
    tried.push_back(rung_with(ladder, terms));
    added.push_back(&term);
  }
  FitOptions one = options;
  one.threads = 1;
  in_parallel(static_cast<int>(tried.size()), options.threads, [&](int i) {
    Rung& rung = tried[static_cast<std::size_t>(i)];
    fit_rung(tracks, &known, added[static_cast<std::size_t>(i)], options_for(rung, one), rung);
  });
  const Rung* best = least_bic(tried);  // of the others a longer way may make more
  return best != nullptr && explains(*best) ? std::optional(*best) : std::nullopt;
}

// The likeliest rung from which no exchange has been made yet, of those whose evidence is as good
// as the chosen one's, if there is one: two losses together may stand for two others, with none of
// which alone they are exchanged. Those of a sliding body are dear.
const Rung* as_good(const std::vector<Rung>& rungs, const Rung& chosen,
                    const std::set<const Rung*>& exchanged) {
  constexpr double kBareMention = 2.0;  // of BIC
  const Rung* best = nullptr;
  if (chosen.fit.model == "sliding") return best;
  for (const Rung& rung : rungs)
    if (rung.fitted && rung.fit.converged && !exchanged.contains(&rung) &&
        rung.bic < chosen.bic + kBareMention && (best == nullptr || rung.bic < best->bic))
      best = &rung;
  return best;
}

// Of the known rungs the simplest that suffices, and from it on by what may do better, as long as
// that changes which it is; then from others that are as good.
const Rung* exchange_while_worth(const Ladder& ladder, std::span<const data::Track> tracks,
                                 const FitOptions& options, std::vector<Rung>& rungs) {
  const Rung* chosen = simplest_sufficient(ladder, rungs);
  std::set<const Rung*> exchanged;
  for (std::size_t round = 0; round < kMostRounds && chosen != nullptr && chosen->fit.converged;
       ++round) {
    // A term found that way asks for the others anew, unless even then the model lacks something.
    if (round > 0 && chosen->fit.verdict == "unexplained") break;
    const Rung* from = exchanged.contains(chosen) ? as_good(rungs, *chosen, exchanged) : chosen;
    if (from == nullptr) break;
    exchanged.insert(from);
    chosen = exchange_terms(ladder, tracks, options, *from, rungs);
  }
  return chosen;
}

// References to rungs stay valid while more are added.
std::vector<Rung> no_rungs(const Ladder& ladder) {
  std::vector<Rung> rungs;
  const std::size_t terms = ladder.terms.size();
  rungs.reserve(4 + (3 * kMostTerms + 3) * terms + (kMostRounds + 1) * terms * (terms + 1));
  return rungs;
}

// The losses of a rung and of others that are as likely, up to so many.
std::set<int> as_likely(const std::vector<Rung>& rungs, const Rung& chosen, std::size_t most) {
  std::vector<const Rung*> near;
  for (const Rung& rung : rungs)
    if (rung.fitted && rung.fit.converged && rung.bic < chosen.bic + kStrong) near.push_back(&rung);
  std::sort(near.begin(), near.end(), [](const Rung* a, const Rung* b) { return a->bic < b->bic; });
  std::set<int> terms = chosen.terms;
  for (const Rung* rung : near) {
    std::set<int> more = terms;
    more.insert(rung->terms.begin(), rung->terms.end());
    if (more.size() <= most) terms = std::move(more);
  }
  return terms;
}

// With other losses a body may be seen to roll for longer: those that a first part of the track
// asks for explain more of it, which asks for others. @param known  explains that first part.
// @returns a rung that explains about as long a first part as any, or all of the track; of losses
// that do so alike it has several.
Rung longest_rolling(const Ladder& ladder, std::span<const data::Track> tracks,
                     const FitOptions& options, Rung known) {
  constexpr double kSurely = 0.9;  // of the first part: before its end a slip may have begun
  constexpr double kLonger = 1.05, kAsLong = 0.85;  // of its duration
  constexpr int kMostParts = 4;
  const double from_s = known.first_part.from_s;  // later than the track's where it is cut
  for (int part = 0; part < kMostParts; ++part) {
    const double before_s = known.first_part.until_s - from_s;
    FitOptions early = options;
    early.to = fmt::format("{:.17g}", from_s + kSurely * before_s);
    std::vector<Rung> rungs = no_rungs(ladder);
    rungs.push_back(rung_with(ladder, known.terms));
    fit_from_values(tracks, known.first_part.values, options_for(rungs[0], early), rungs[0]);
    step_down(ladder, tracks, early, 0, rungs);
    const Rung* chosen = exchange_while_worth(ladder, tracks, early, rungs);
    if (chosen == nullptr || !chosen->fit.converged) break;
    Rung longer = rung_with(ladder, as_likely(rungs, *chosen, kMostTerms));
    fit_from_first_part(tracks, {values_of(chosen->fit), 0.0, 0.0}, options_for(longer, options),
                        longer);
    if (explains(longer)) return longer;
    const double after_s = longer.first_part.until_s - from_s;
    if (!longer.first_part.empty() && after_s > kAsLong * before_s) known = std::move(longer);
    if (after_s < kLonger * before_s) break;
  }
  return known;
}

// What seems to roll first and to slide later may creep all the time, where friction sets in
// softly: searched from the beginning, with all that usually acts.
void creep(const Ladder& ladder, std::span<const data::Track> tracks, const FitOptions& options,
           std::vector<Rung>& rungs) {
  const std::set<int> terms = all_that_usually_acts(ladder, {});
  if (terms.empty()) return;
  Rung creeps = rung_with(ladder, terms);
  fit_rung(tracks, nullptr, nullptr, options_for(creeps, options), creeps);
  if (!explains(creeps)) return;
  rungs.push_back(std::move(creeps));
  step_down(ladder, tracks, options, rungs.size() - 1, rungs);
}

// A body that rolls first slides later: with what acts while it rolls, then with all that usually
// acts. @returns whether a rung was added that explains the track, or follows it to its end and is
// to go on from.
bool slide_after_rolling(const Ladder& ladder, std::span<const data::Track> tracks,
                         const FitOptions& options, const Rung& known, std::vector<Rung>& rungs) {
  const Rung rolling = longest_rolling(ladder, tracks, options, known);
  if (explains(rolling)) {
    rungs.push_back(rolling);
    step_down(ladder, tracks, options, rungs.size() - 1, rungs);
    return true;
  }
  std::vector<std::pair<std::set<int>, FirstPart>> ways{
      {with_last_resort(ladder, rolling.terms), rolling.first_part}};
  if (rolling.terms != known.terms)
    ways.emplace_back(all_that_usually_acts(ladder, {}), known.first_part);
  for (const auto& [terms, part] : ways) {
    if (terms.empty()) continue;  // no floor on which it may slide
    Rung slides = rung_with(ladder, terms);
    fit_from_first_part(tracks, part, options_for(slides, options), slides);
    if (!usable(slides.fit) || !slides.fit.converged) continue;
    rungs.push_back(std::move(slides));
    // What follows the track to its end needs other losses, not another search.
    if (explains(rungs.back()))
      step_down(ladder, tracks, options, rungs.size() - 1, rungs);
    else
      creep(ladder, tracks, options, rungs);
    return true;
  }
  return false;
}

// Where the plainest model explains nothing its solution leads nowhere, and neither does that of
// one with a single loss if several act: all usual losses together, then fewer of them. Where that
// explains a first part of the track alone, further losses act as well, of which one is added at a
// time while each helps, or the body slides from there on. @returns whether one of these explains
// the track, or follows it and is to go on from.
bool climb_down(const Ladder& ladder, std::span<const data::Track> tracks,
                const FitOptions& options, std::vector<Rung>& rungs) {
  const std::set<int> usual = usual_losses(ladder);
  if (usual.empty()) return false;
  const std::size_t all = rungs.size();
  rungs.push_back(rung_with(ladder, usual));
  fit_rung(tracks, nullptr, nullptr, options_for(rungs[all], options), rungs[all]);
  if (explains(rungs[all])) {
    step_down(ladder, tracks, options, all, rungs);
    return true;
  }
  if (auto other = by_another_law(ladder, tracks, options, rungs[all])) {
    rungs.push_back(*std::move(other));
    step_down(ladder, tracks, options, rungs.size() - 1, rungs);
    return true;
  }
  if (rungs[all].first_part.empty()) return false;
  double known_bic = rungs[all].bic;
  std::vector<std::set<int>> sets = with_one_more(ladder, usual);
  for (std::size_t more = 1; more <= kMostTerms; ++more) {
    std::vector<Rung> tried;
    for (const std::set<int>& terms : sets) tried.push_back(rung_with(ladder, terms));
    FitOptions one = options;
    one.threads = 1;
    in_parallel(static_cast<int>(tried.size()), options.threads, [&](int i) {
      Rung& rung = tried[static_cast<std::size_t>(i)];
      fit_from_first_part(tracks, rungs[all].first_part, options_for(rung, one), rung);
    });
    const Rung* best = least_bic(tried);
    if (best != nullptr && explains(*best)) {
      rungs.push_back(*best);  // of the others a search of their own may make more
      step_down(ladder, tracks, options, rungs.size() - 1, rungs);
      return true;
    }
    // Two may act that each alone follow the track not much farther.
    if (best == nullptr || !(best->bic < known_bic - kVeryStrong)) break;
    known_bic = best->bic;
    sets = with_one_more(ladder, best->terms);
  }
  return slide_after_rolling(ladder, tracks, options, rungs[all], rungs);
}

// The longest part of the track, from its beginning on, that one of the rungs explains.
FirstPart longest_first_part(const std::vector<Rung>& rungs) {
  FirstPart longest;
  for (const Rung& rung : rungs)
    if (!rung.first_part.empty() && (longest.empty() || rung.first_part.until_s > longest.until_s))
      longest = rung.first_part;
  return longest;
}

// The plainest model and, one more term at a time, all extensions of the best so far.
std::vector<Rung> climb(const Ladder& ladder, std::span<const data::Track> tracks,
                        const FitOptions& options) {
  std::vector<Rung> rungs = no_rungs(ladder);
  rungs.push_back(rung_with(ladder, {}));
  fit_rung(tracks, nullptr, nullptr, options_for(rungs[0], options), rungs[0]);
  const bool searched = !explains(rungs[0]) && !usual_losses(ladder).empty();
  if (searched && climb_down(ladder, tracks, options, rungs)) return rungs;
  // Where a search with all usual losses led nowhere, one with fewer does not either.
  const Reach reach = searched ? Reach::from_below : Reach::search;
  const std::size_t current = step_up_while_worth(ladder, tracks, options, reach, 0, rungs);
  if (explains(rungs[current])) {
    // What stood in for another loss while that was missing may not be needed beside it.
    step_down(ladder, tracks, options, current, rungs);
    return rungs;
  }
  if (const std::optional<int> none = smooth_term(ladder)) {
    std::size_t smooth = rungs.size();
    rungs.push_back(rung_with(ladder, {*none}));
    fit_rung(tracks, nullptr, nullptr, options_for(rungs.back(), options), rungs.back());
    if (rungs[smooth].fitted && rungs[smooth].bic < rungs[current].bic)
      smooth = step_up_while_worth(ladder, tracks, options, Reach::search, smooth, rungs);
    if (rungs[smooth].fit.converged && explains(rungs[smooth])) {
      step_down(ladder, tracks, options, smooth, rungs);
      return rungs;
    }
  }
  // Where nothing leads anywhere, the last resort alone does not either.
  if (rungs[current].fit.converged) {
    const std::size_t last = step_up(ladder, tracks, options, true, Reach::search, current, rungs);
    if (last != current && explains(rungs[last])) {
      step_down(ladder, tracks, options, last, rungs);
      return rungs;
    }
  }
  // What helped a model that explains nothing tells nothing.
  const std::set<int> helped =
      rungs[current].fit.converged ? rungs[current].terms : std::set<int>{};
  if (const auto all = all_that_usually_acts(ladder, helped); !all.empty()) {
    const FirstPart rolls = longest_first_part(rungs);
    rungs.push_back(rung_with(ladder, all));
    rungs.back().first_part = rolls;
    fit_rung(tracks, nullptr, nullptr, options_for(rungs.back(), options), rungs.back());
    step_down(ladder, tracks, options, rungs.size() - 1, rungs);
  }
  return rungs;
}

bool show_spin(std::span<const data::Track> tracks) {
  return std::any_of(tracks.begin(), tracks.end(), [](const data::Track& track) {
    return std::any_of(track.samples.begin(), track.samples.end(),
                       [](const data::TrackSample& sample) { return sample.psi.has_value(); });
  });
}

std::set<std::string> parameters_of_any(const Ladder& ladder) {
  std::set<std::string> names = parameters_of(ladder.plain);
  for (int index = 0; index < static_cast<int>(ladder.terms.size()); ++index) {
    std::set<int> terms{index};
    if (const auto of = ladder.terms[static_cast<std::size_t>(index)].of) terms.insert(*of);
    names.merge(parameters_of(rung_with(ladder, terms).scene));
  }
  return names;
}

// @throws InputError for a name that means nothing to any of the models.
void check_names(const data::FitSettings& fit, const std::set<std::string>& known) {
  const auto check = [&](const char* key, const std::string& name) {
    if (!names_one_of(known, name))
      throw InputError(
          fmt::format("[fit] {}: the models compared have no parameter '{}'; they have "
                      "{}",
                      key, name, fmt::join(known, ", ")));
  };
  for (const std::string& name : fit.free) check("free", name);
  for (const auto& [name, value] : fit.fixed) check("fixed", name);
  for (const auto& [name, bounds] : fit.bounds) check("bounds", name);
}

data::ModelScore table_row(const Rung& rung, bool recommended) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  if (!rung.fitted) return {rung.name, kNone, kNone, kNone, kNone, kNone, 0, false, rung.reason};
  return {rung.name,       rung.fit.chi2,        rung.aicc,
          rung.bic,        rung.fit.whiteness_p, rung.held_back_rms_sigma,
          rung.parameters, recommended,          rung.reason};
}

std::vector<data::ModelScore> table_of(const std::vector<Rung>& rungs, const Rung* chosen) {
  std::vector<data::ModelScore> table;
  for (const Rung& rung : rungs) table.push_back(table_row(rung, &rung == chosen));
  return table;
}

// Of the others the comparison does not need to know.
void predict_held_back_by_near_ones(std::span<const data::Track> tracks, const FitOptions& options,
                                    std::vector<Rung>& rungs, const Rung& chosen) {
  std::vector<Rung*> near;
  for (Rung& rung : rungs)
    if (rung.bic < chosen.bic + most_evidence_against(chosen)) near.push_back(&rung);
  FitOptions one = options;
  one.threads = 1;
  in_parallel(static_cast<int>(near.size()), options.threads, [&](int i) {
    Rung& rung = *near[static_cast<std::size_t>(i)];
    predict_held_back(tracks, options_for(rung, one), rung);
  });
}

}  // namespace

Comparison compare(std::span<const data::Track> tracks, const data::Scene& scene,
                   const FitOptions& options) {
  data::Scene named = scene;
  if (!options.model.empty()) named.model.name = options.model;
  // A body held at a pivot that leans there is a top, one that lies on it only turns.
  const bool open = named.model.name == "auto" && named.support.kind == data::SupportKind::pivot;
  if (open && leaves_pivot(tracks, named)) named.model.name = "top";
  free_all_terms(named.fit);
  const Ladder ladder = ladder_of(named, show_spin(tracks));
  const std::set<std::string> known = parameters_of_any(ladder);
  check_names(scene.fit, known);
  check_first_guess(options.start, "the models compared have", known);
  FitOptions plain = options;
  plain.profile = false;
  plain.bootstrap = 0;
  plain.model.clear();
  std::vector<Rung> rungs = climb(ladder, tracks, plain);
  let_go_of_friction(ladder, tracks, plain, rungs);
  const Rung* chosen = exchange_while_worth(ladder, tracks, plain, rungs);
  if (chosen == nullptr) {
    Comparison none{rungs[0].fit, rungs[0].scene};
    none.fit.comparison = table_of(rungs, nullptr);
    return none;
  }
  predict_held_back_by_near_ones(tracks, plain, rungs, *chosen);
  Comparison result{with_full_bars(*chosen), chosen->scene};
  if (options.profile || options.bootstrap > 0) {
    FitOptions again = options;
    again.model.clear();
    again.rolls_at_first = chosen->rolls_at_first;
    again.start = values_of(chosen->fit);
    if (!again.start.empty()) again.strategy = "single";
    try {
      result.fit = fit_one_of_several(tracks, chosen->scene, again);
    } catch (const NumericalError& error) {
      result.fit.warnings.push_back(fmt::format("no profile and no bootstrap: {}", error.what()));
    }
  }
  if (result.fit.converged) {
    allow_for_rivals(rungs, *chosen, result.fit);
    doubt_if_drifting(tracks, *chosen, plain, result.fit);
  }
  result.fit.comparison = table_of(rungs, chosen);
  result.fit.recommendation = sentence(rungs, *chosen, ladder);
  return result;
}

}  // namespace trochoid::fitting
