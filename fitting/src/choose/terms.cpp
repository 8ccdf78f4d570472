#include "choose/terms.hpp"

#include <algorithm>
#include <utility>

#include "judge/first_guess.hpp"
#include "problem/problem.hpp"

namespace trochoid::fitting {
namespace {

const Term& term_of(const Ladder& ladder, int index) {
  return ladder.terms[static_cast<std::size_t>(index)];
}

int count_of(const Ladder& ladder) {
  return static_cast<int>(ladder.terms.size());
}

// Tried among others.
bool is_ordinary(const Term& term) {
  return !term.last_resort && !term.slope;
}

std::string name_of(const Ladder& ladder, const Terms& terms) {
  std::string name = ladder.law, added;
  for (const int index : terms) {
    const Term& term = term_of(ladder, index);
    if (term.smooth)
      name = "smooth floor";
    else
      added += " + " + term.name;
  }
  return name + added;
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

}  // namespace

bool names_one_of(const std::set<std::string>& parameters, const std::string& name) {
  return std::any_of(parameters.begin(), parameters.end(),
                     [&](const std::string& parameter) { return means(name, parameter); });
}

bool says_something_of(const data::FitSettings& fit, const std::set<std::string>& parameters) {
  const auto one_of = [&](const auto& said) {
    return std::any_of(said.begin(), said.end(),
                       [&](const auto& item) { return names_one_of(parameters, item.first); });
  };
  return one_of(fit.fixed) || one_of(fit.prior) || one_of(fit.bounds);
}

Rung rung_with(const Ladder& ladder, const Terms& terms) {
  Rung rung;
  rung.terms = terms;
  rung.name = name_of(ladder, terms);
  rung.scene = ladder.plain;
  for (const int term : terms) term_of(ladder, term).switch_on(rung.scene);
  keep_own(rung.scene);
  return rung;
}

std::set<std::string> parameters_of_any(const Ladder& ladder) {
  std::set<std::string> names = parameters_of(ladder.plain);
  for (int index = 0; index < count_of(ladder); ++index) {
    Terms terms{index};
    if (const auto of = term_of(ladder, index).of) terms.insert(*of);
    names.merge(parameters_of(rung_with(ladder, terms).scene));
  }
  return names;
}

std::set<std::string> parameters_without(const Ladder& ladder, const Terms& terms,
                                         const Terms& fewer) {
  std::set<std::string> own = parameters_of(rung_with(ladder, terms).scene);
  for (const std::string& name : parameters_of(rung_with(ladder, fewer).scene)) own.erase(name);
  return own;
}

std::set<std::string> parameters_of_losses(const Ladder& ladder, const Terms& terms) {
  Terms law = terms;
  std::erase_if(law, [&](int index) { return is_ordinary(term_of(ladder, index)); });
  return parameters_without(ladder, terms, law);
}

std::optional<int> smooth_term(const Ladder& ladder) {
  for (int index = 0; index < count_of(ladder); ++index)
    if (term_of(ladder, index).smooth) return index;
  return std::nullopt;
}

std::optional<int> slope_term(const Ladder& ladder) {
  for (int index = 0; index < count_of(ladder); ++index)
    if (term_of(ladder, index).slope) return index;
  return std::nullopt;
}

bool means_something(const Ladder& ladder, const Terms& terms, int index) {
  const std::optional<int> of = term_of(ladder, index).of;
  return !of || terms.contains(*of);
}

bool may_go(const Ladder& ladder, const Terms& terms, int index) {
  return !term_of(ladder, index).last_resort &&
         std::all_of(terms.begin(), terms.end(),
                     [&](int other) { return term_of(ladder, other).of != index; });
}

Terms usual_losses(const Ladder& ladder) {
  Terms terms;
  for (int index = 0; index < count_of(ladder); ++index)
    if (term_of(ladder, index).usual) terms.insert(index);
  return terms;
}

Terms other_laws(const Ladder& ladder, const Terms& terms) {
  Terms others;
  for (int index = 0; index < count_of(ladder); ++index)
    if (const auto of = term_of(ladder, index).other_law_of; of && terms.contains(*of))
      others.insert(index);
  return others;
}

Terms with_last_resort(const Ladder& ladder, Terms terms) {
  bool resort = false;
  for (int index = 0; index < count_of(ladder); ++index) {
    if (!term_of(ladder, index).last_resort || term_of(ladder, index).smooth) continue;
    resort = true;
    terms.insert(index);
  }
  return resort ? terms : Terms{};
}

Terms all_that_usually_acts(const Ladder& ladder, Terms terms) {
  terms.merge(usual_losses(ladder));
  return with_last_resort(ladder, std::move(terms));
}

std::vector<Terms> with_one_more(const Ladder& ladder, const Terms& terms) {
  std::vector<Terms> sets;
  for (int index = 0; index < count_of(ladder); ++index) {
    if (terms.contains(index) || !means_something(ladder, terms, index) ||
        !is_ordinary(term_of(ladder, index)))
      continue;
    sets.push_back(terms);
    sets.back().insert(index);
  }
  return sets;
}

namespace {

// The terms with and without each of the open ones; a key has a bit for each of these.
std::map<int, Terms> sets_of(const Terms& terms, const std::vector<int>& open) {
  std::map<int, Terms> sets;
  for (int key = 0; key < 1 << open.size(); ++key) {
    Terms& set = sets[key] = terms;
    for (std::size_t bit = 0; bit < open.size(); ++bit)
      if ((key >> bit & 1) != 0)
        set.insert(open[bit]);
      else
        set.erase(open[bit]);
  }
  return sets;
}

}  // namespace

std::map<int, Terms> all_sets(const Ladder& ladder, const Terms& known) {
  std::vector<int> open;
  for (int index = 0; index < count_of(ladder); ++index)
    if (is_ordinary(term_of(ladder, index)) ||
        (term_of(ladder, index).slope && known.contains(index)))
      open.push_back(index);
  std::map<int, Terms> sets = sets_of(known, open);
  std::erase_if(sets, [&](const auto& item) {
    return !std::all_of(item.second.begin(), item.second.end(),
                        [&](int term) { return means_something(ladder, item.second, term); });
  });
  return sets;
}

std::map<int, Terms> with_usual_losses(const Ladder& ladder, const Terms& terms) {
  std::vector<int> open;
  for (const int index : usual_losses(ladder))
    if (!terms.contains(index)) open.push_back(index);
  std::map<int, Terms> sets = sets_of(terms, open);
  sets.erase(0);
  return sets;
}

Difference difference(const Terms& terms, const Terms& known) {
  const auto beyond = [](const Terms& these, const Terms& others) {
    return static_cast<std::size_t>(std::count_if(
        these.begin(), these.end(), [&](int term) { return !others.contains(term); }));
  };
  return {beyond(terms, known), beyond(known, terms)};
}

}  // namespace trochoid::fitting
