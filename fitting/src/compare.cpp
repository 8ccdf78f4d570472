#include "trochoid/fitting/compare.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
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
  std::string name = ladder.law;
  for (const int term : terms) name += " + " + ladder.terms[static_cast<std::size_t>(term)].name;
  return name;
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

// Every rung frees the terms it has: a list made for one of them would hold the others' fixed. What
// leaves the model its own choice of the rest stays.
void free_all_terms(data::FitSettings& fit) {
  const auto listed = [&](const char* name) {
    return std::find(fit.free.begin(), fit.free.end(), name) != fit.free.end();
  };
  fit.free_pivot = fit.free_pivot || listed("pivot_x_m") || listed("pivot_y_m");
  std::erase_if(fit.free, [](const std::string& name) {
    return name != kReadout && name != kAngleDelay && name != kSlipScale;
  });
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

Rung frictionless_rung(const Ladder& ladder) {
  Rung rung;
  rung.name = "smooth floor";
  rung.scene = *ladder.frictionless;
  keep_own(rung.scene);
  return rung;
}

// For one of several rungs that are fitted side by side; what is said of it names it.
FitOptions options_for(const Rung& rung, const FitOptions& options) {
  FitOptions own = options;
  if (options.progress)
    own.progress = [&rung, &options](const std::string& stage) {
      options.progress(fmt::format("{}: {}", rung.name, stage));
    };
  if (options.log)
    own.log = [&rung, &options](const std::string& line) {
      options.log(fmt::format("{}: {}", rung.name, line));
    };
  return own;
}

// All extensions of rungs[current] by one term, tried at the same time. @returns the index of the
// best rung now known.
std::size_t step_up(const Ladder& ladder, std::span<const data::Track> tracks,
                    const FitOptions& options, bool last_resort, std::size_t current,
                    std::vector<Rung>& rungs) {
  const std::size_t first = rungs.size();
  std::vector<const Term*> added;
  for (int index = 0; index < static_cast<int>(ladder.terms.size()); ++index) {
    const Term& term = ladder.terms[static_cast<std::size_t>(index)];
    std::set<int> terms = rungs[current].terms;
    if (term.last_resort != last_resort || !terms.insert(index).second) continue;
    rungs.push_back(rung_with(ladder, terms));
    added.push_back(&term);
  }
  FitOptions one = options;
  one.threads = 1;
  in_parallel(static_cast<int>(added.size()), options.threads, [&](int i) {
    const auto n = static_cast<std::size_t>(i);
    Rung& rung = rungs[first + n];
    fit_rung(tracks, &rungs[current], added[n], options_for(rung, one), rung);
  });
  std::size_t best = current;
  for (std::size_t i = first; i < rungs.size(); ++i)
    if (rungs[i].fitted && (!rungs[best].fitted || rungs[i].bic < rungs[best].bic)) best = i;
  return best;
}

// The last resort together with the usual losses: a body that slides without any may not even stay
// on the floor as long as the track. Empty where there is no last resort.
std::set<int> all_that_usually_acts(const Ladder& ladder, std::set<int> terms) {
  bool resort = false;
  for (int index = 0; index < static_cast<int>(ladder.terms.size()); ++index) {
    const Term& term = ladder.terms[static_cast<std::size_t>(index)];
    resort = resort || term.last_resort;
    if (term.last_resort || term.usual) terms.insert(index);
  }
  return resort ? terms : std::set<int>{};
}

// Fits the rungs with these sets of terms that are not known yet, side by side, from the solution
// of rungs[known].
void add_neighbours(const Ladder& ladder, std::span<const data::Track> tracks,
                    const FitOptions& options, const std::vector<std::set<int>>& wanted,
                    std::size_t known, std::vector<Rung>& rungs) {
  const std::size_t first = rungs.size();
  for (const std::set<int>& terms : wanted)
    if (std::none_of(rungs.begin(), rungs.end(),
                     [&](const Rung& rung) { return rung.terms == terms; }))
      rungs.push_back(rung_with(ladder, terms));
  FitOptions one = options;
  one.threads = 1;
  in_parallel(static_cast<int>(rungs.size() - first), options.threads, [&](int i) {
    Rung& rung = rungs[first + static_cast<std::size_t>(i)];
    fit_neighbour(tracks, rungs[known], options_for(rung, one), rung);
  });
}

// The terms without one of `these`; the last resort stays.
std::vector<std::set<int>> with_one_less(const Ladder& ladder, const std::set<int>& terms,
                                         const std::set<int>& these) {
  std::vector<std::set<int>> sets;
  for (const int index : these) {
    if (ladder.terms[static_cast<std::size_t>(index)].last_resort) continue;
    sets.push_back(terms);
    sets.back().erase(index);
  }
  return sets;
}

// The terms with one more; the last resort is not added.
std::vector<std::set<int>> with_one_more(const Ladder& ladder, const std::set<int>& terms) {
  std::vector<std::set<int>> sets;
  for (int index = 0; index < static_cast<int>(ladder.terms.size()); ++index) {
    if (terms.contains(index) || ladder.terms[static_cast<std::size_t>(index)].last_resort)
      continue;
    sets.push_back(terms);
    sets.back().insert(index);
  }
  return sets;
}

// Everything but the last resort was added before it was known what that explains: terms the data
// do not need any more are left out again, one at a time, as long as that costs no strong evidence.
void step_down(const Ladder& ladder, std::span<const data::Track> tracks, const FitOptions& options,
               std::size_t current, std::vector<Rung>& rungs) {
  while (rungs[current].fitted && rungs[current].fit.converged) {
    const std::size_t first = rungs.size();
    const std::set<int> terms = rungs[current].terms;
    add_neighbours(ladder, tracks, options, with_one_less(ladder, terms, terms), current, rungs);
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

// Whether a fitted rung's losses that a smaller one lacks may be zero, by their error bars.
bool may_do_without(const Rung& rung, const Rung& smaller) {
  constexpr double kSurely = 4.0;  // sigmas, which curvature may misjudge
  if (!rung.fitted || !rung.fit.converged) return false;
  std::set<std::string> lost = parameters_of(rung.scene);
  for (const std::string& name : parameters_of(smaller.scene)) lost.erase(name);
  lost.erase(kSlipScale);  // the smaller one's is fitted anew
  return std::all_of(lost.begin(), lost.end(), [&](const std::string& name) {
    const data::FitParameter* loss = rung.fit.find(name);
    return loss != nullptr && std::abs(loss->value) < kSurely * loss->sigma;
  });
}

// Terms are added one at a time, by what is gained at once, and those of a last resort all
// together: what never stood beside the others may do as well as one of them. Every term left is
// added to a rung, and put in the place of those that are not sure beside it.
void exchange_terms(const Ladder& ladder, std::span<const data::Track> tracks,
                    const FitOptions& options, std::size_t current, std::vector<Rung>& rungs) {
  const std::set<int> terms = rungs[current].terms;
  const auto larger = with_one_more(ladder, terms);
  add_neighbours(ladder, tracks, options, larger, current, rungs);
  std::vector<std::set<int>> exchanged;
  for (const Rung& rung : rungs) {
    if (std::find(larger.begin(), larger.end(), rung.terms) == larger.end()) continue;
    for (std::set<int>& others : with_one_less(ladder, rung.terms, terms))
      if (may_do_without(rung, rung_with(ladder, others))) exchanged.push_back(std::move(others));
  }
  add_neighbours(ladder, tracks, options, exchanged, current, rungs);
}

// The plainest model and, one more term at a time, all extensions of the best so far.
std::vector<Rung> climb(const Ladder& ladder, std::span<const data::Track> tracks,
                        const FitOptions& options) {
  constexpr std::size_t kMostTerms = 3;
  std::vector<Rung> rungs;
  // References to rungs stay valid while more are added.
  const std::size_t terms = ladder.terms.size();
  rungs.reserve(3 + (kMostTerms + 1) * terms + terms * (terms + 1) / 2);
  rungs.push_back(rung_with(ladder, {}));
  fit_rung(tracks, nullptr, nullptr, options_for(rungs[0], options), rungs[0]);
  std::size_t current = 0;
  for (std::size_t size = 1; size <= std::min(kMostTerms, ladder.terms.size()); ++size) {
    const std::size_t best = step_up(ladder, tracks, options, false, current, rungs);
    const bool worth = best != current && rungs[best].bic < rungs[current].bic - kStrong;
    if (!worth) break;
    current = best;
  }
  // Residuals that hang together but hardly exceed the track's own noise are the tracker's.
  constexpr double kTrackersOwn = 1.3;
  const auto explains = [&](std::size_t i) {
    const std::string& verdict = rungs[i].fit.verdict;
    return rungs[i].fitted && verdict != "doubtful" && verdict != "unexplained" &&
           (rungs[i].fit.whiteness_p >= kWhite || rungs[i].fit.noise_scale <= kTrackersOwn);
  };
  if (explains(current)) return rungs;
  if (ladder.frictionless) {
    rungs.push_back(frictionless_rung(ladder));
    fit_rung(tracks, nullptr, nullptr, options_for(rungs.back(), options), rungs.back());
    if (rungs.back().fit.converged && explains(rungs.size() - 1)) return rungs;
  }
  // Where nothing leads anywhere, the last resort alone does not either.
  if (rungs[current].fit.converged) {
    const std::size_t last = step_up(ladder, tracks, options, true, current, rungs);
    if (last != current && explains(last)) {
      step_down(ladder, tracks, options, last, rungs);
      return rungs;
    }
  }
  // What helped a model that explains nothing tells nothing.
  const std::set<int> helped =
      rungs[current].fit.converged ? rungs[current].terms : std::set<int>{};
  if (const auto all = all_that_usually_acts(ladder, helped); !all.empty()) {
    rungs.push_back(rung_with(ladder, all));
    fit_rung(tracks, nullptr, nullptr, options_for(rungs.back(), options), rungs.back());
    step_down(ladder, tracks, options, rungs.size() - 1, rungs);
  }
  return rungs;
}

std::set<std::string> parameters_of_any(const Ladder& ladder) {
  std::set<std::string> names = parameters_of(ladder.plain);
  if (ladder.frictionless) names.merge(parameters_of(*ladder.frictionless));
  for (int term = 0; term < static_cast<int>(ladder.terms.size()); ++term)
    names.merge(parameters_of(rung_with(ladder, {term}).scene));
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

}  // namespace

Comparison compare(std::span<const data::Track> tracks, const data::Scene& scene,
                   const FitOptions& options) {
  data::Scene named = scene;
  if (!options.model.empty()) named.model.name = options.model;
  // A body held at a pivot that leans there is a top, one that lies on it only turns.
  const bool open = named.model.name == "auto" && named.support.kind == data::SupportKind::pivot;
  if (open && leaves_pivot(tracks, named)) named.model.name = "top";
  free_all_terms(named.fit);
  const Ladder ladder = ladder_of(named);
  const std::set<std::string> known = parameters_of_any(ladder);
  check_names(scene.fit, known);
  check_first_guess(options.start, "the models compared have", known);
  FitOptions plain = options;
  plain.profile = false;
  plain.bootstrap = 0;
  plain.model.clear();
  std::vector<Rung> rungs = climb(ladder, tracks, plain);
  const Rung* chosen = simplest_sufficient(ladder, rungs);
  if (chosen != nullptr && chosen->fit.converged) {
    exchange_terms(ladder, tracks, plain, static_cast<std::size_t>(chosen - rungs.data()), rungs);
    chosen = simplest_sufficient(ladder, rungs);
  }
  if (chosen == nullptr) {
    Comparison none{rungs[0].fit, rungs[0].scene};
    none.fit.comparison = table_of(rungs, nullptr);
    return none;
  }
  Comparison result{chosen->fit, chosen->scene};
  if (options.profile || options.bootstrap > 0) {
    FitOptions again = options;
    again.model.clear();
    again.start = values_of(chosen->fit);
    if (!again.start.empty()) again.strategy = "single";
    try {
      result.fit = fit_one_of_several(tracks, chosen->scene, again);
    } catch (const NumericalError& error) {
      result.fit.warnings.push_back(fmt::format("no profile and no bootstrap: {}", error.what()));
    }
  }
  if (result.fit.converged) allow_for_rivals(rungs, *chosen, result.fit);
  result.fit.comparison = table_of(rungs, chosen);
  result.fit.recommendation = sentence(rungs, *chosen, ladder);
  return result;
}

}  // namespace trochoid::fitting
