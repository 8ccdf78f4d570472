#include "trochoid/fitting/compare.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "choose/climb.hpp"
#include "choose/exchange.hpp"
#include "choose/held_back.hpp"
#include "choose/leave_out.hpp"
#include "choose/off_level.hpp"
#include "choose/rung_words.hpp"
#include "choose/slide.hpp"
#include "choose/softness.hpp"
#include "choose/terms.hpp"
#include "judge/adequacy.hpp"
#include "judge/first_guess.hpp"
#include "judge/straying.hpp"
#include "judge/tracks_apart.hpp"
#include "problem/problem.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::fitting {
namespace {

// Every rung frees the terms it has: a list made for one of them would hold the others' fixed.
void free_all_terms(data::FitSettings& fit) {
  std::erase_if(fit.free, [](const std::string& name) { return !leaves_choice(name); });
}

bool show_spin(std::span<const data::Track> tracks) {
  return std::any_of(tracks.begin(), tracks.end(), [](const data::Track& track) {
    return std::any_of(track.samples.begin(), track.samples.end(),
                       [](const data::TrackSample& sample) { return sample.psi.has_value(); });
  });
}

// A scene as its ladder is made from.
data::Scene to_be_compared(const data::Scene& scene, const FitOptions& options) {
  data::Scene named = scene;
  if (!options.model.empty()) named.model.name = options.model;
  free_all_terms(named.fit);
  return named;
}

// What is held at a pivot may be either of two models, unless the tracks say which.
bool may_lean_or_lie(const data::Scene& named) {
  return named.model.name == "auto" && named.support.kind == data::SupportKind::pivot;
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
  return {
      rung.name,       rung.fit.chi2,        rung.aicc,
      rung.bic,        rung.fit.whiteness_p, rung.held_back_rms_sigma,
      rung.parameters, recommended,          recommended && rung.fit.converged ? "" : rung.reason};
}

// What never came to be tried has no row.
std::vector<data::ModelScore> table_of(const Rungs& rungs, const Rung* chosen) {
  std::vector<data::ModelScore> table;
  for (const Rung* rung : told(rungs, chosen))
    if (rung->fitted || !rung->reason.empty()) table.push_back(table_row(*rung, rung == chosen));
  return table;
}

// Of the others the comparison does not need to know.
std::vector<Rung*> near_ones(Rungs& rungs, const Rung& chosen, double evidence_against) {
  std::vector<Rung*> near;
  for (Rung& rung : rungs)
    if (rung.bic < chosen.bic + evidence_against) near.push_back(&rung);
  return near;
}

void predict_held_back_by_near_ones(const Contest& contest, Rungs& rungs, const Rung& chosen) {
  side_by_side(contest, near_ones(rungs, chosen, most_evidence_against(chosen)),
               [&](std::size_t, Rung& rung, const FitOptions& options) {
                 predict_held_back(contest.tracks, options, rung);
               });
}

// A slip that friction ends within a few samples is not seen, so the chosen rung may as well roll
// at first. Under friction that sets in softly this is tried only here, at the end: earlier it
// would make many more sets of losses look alike. As it was it stays as a rival.
void let_chosen_roll_at_first(const Contest& contest, Rungs& rungs, const Rung& chosen) {
  if (chosen.rolls_at_first || softness_is_open(chosen)) return;
  const auto own =
      std::find_if(rungs.begin(), rungs.end(), [&](const Rung& rung) { return &rung == &chosen; });
  if (own == rungs.end()) return;
  const double aicc = chosen.aicc, bic = chosen.bic;
  const int parameters = chosen.parameters;
  Rung slips = chosen;
  let_roll_at_first(contest.tracks, contest.options, *own);
  if (!chosen.rolls_at_first) return;
  // The others, too, have the velocity to save, and may come into question then.
  const double saved =
      (parameters - chosen.parameters) * std::log(chosen.fit.dof + chosen.parameters);
  side_by_side(contest, near_ones(rungs, chosen, kVeryStrong + saved),
               [&](std::size_t, Rung& rung, const FitOptions& options) {
                 if (&rung != &chosen) begin_as(contest.tracks, chosen, options, rung);
               });
  for (Rung& rung : rungs) {
    if (!rung.by_score_test) continue;  // beside the chosen one, whose scores are others now
    rung.aicc += chosen.aicc - aicc;
    rung.bic += chosen.bic - bic;
    rung.parameters += chosen.parameters - parameters;
  }
  slips.name += ", slipping at first";
  rungs.push_back(std::move(slips));
}

RivalGrounds rival_grounds(const Contest& contest, const Rung& chosen) {
  const bool white = chosen.fit.whiteness_p >= kWhite;
  return {usual_losses(contest.ladder), other_laws(contest.ladder, chosen.terms),
          parameters_of_losses(contest.ladder, chosen.terms),
          white ? 1.0 : variance_inflation(contest.tracks, chosen, contest.options)};
}

}  // namespace

Comparison compare(std::span<const data::Track> tracks, const data::Scene& scene,
                   const FitOptions& options) {
  data::Scene named = to_be_compared(scene, options);
  // A body held at a pivot that leans there is a top, one that lies on it only turns; to tell them
  // apart takes its radius.
  if (may_lean_or_lie(named) && (!named.body || leaves_pivot(tracks, named, options)))
    named.model.name = "top";
  if (!named.body && named.model.name == "auto")
    throw InputError(
        "models can be compared for a [body] with its kind and radius_m; without one name the "
        "model: --model top needs none");
  const Ladder ladder = ladder_of(named, show_spin(tracks));
  const std::set<std::string> known = parameters_of_any(ladder);
  check_names(scene.fit, known);
  check_first_guess(options.start, "the models compared have", known);
  Contest contest{ladder, tracks, options};
  contest.options.profile = false;
  contest.options.bootstrap = 0;
  contest.options.model.clear();
  Rungs rungs = climb(contest);
  let_go_of_friction(contest, rungs);
  const Rung* chosen = exchange_while_worth(contest, rungs);
  if (chosen != nullptr && slope_instead(contest, *chosen, rungs))
    chosen = exchange_while_worth(contest, rungs);
  if (chosen != nullptr &&
      (creep_instead(contest, *chosen, rungs) || soften_instead(contest, *chosen, rungs)))
    chosen = exchange_while_worth(contest, rungs);
  if (chosen != nullptr && roll_instead(contest, *chosen, rungs))
    chosen = exchange_while_worth(contest, rungs);
  if (chosen == nullptr) {
    Comparison none{rungs[0].fit, rungs[0].scene};
    none.fit.comparison = table_of(rungs, nullptr);
    return none;
  }
  let_chosen_roll_at_first(contest, rungs, *chosen);
  add_usual_losses(contest, *chosen, rungs);
  predict_held_back_by_near_ones(contest, rungs, *chosen);
  Comparison result{with_full_bars(*chosen), chosen->scene};
  if (options.profile || options.bootstrap > 0) {
    FitOptions again = options;
    again.model.clear();
    again.rolls_at_first = chosen->rolls_at_first;
    again.start = values_of(chosen->fit);
    again.start_path = chosen->fit.start_path;
    if (!again.start.empty()) again.strategy = Strategy::single;
    try {
      result.fit = fit_one_of_several(tracks, chosen->scene, again);
    } catch (const NumericalError& error) {
      result.fit.warnings.push_back(fmt::format("no profile and no bootstrap: {}", error.what()));
    }
  }
  if (result.fit.converged) {
    // What rivals would make of it, at length, is told last.
    auto& told = result.fit.warnings;
    const auto of_itself = std::ssize(told);
    allow_for_rivals(rungs, *chosen, result.fit, rival_grounds(contest, *chosen));
    const auto of_rivals = std::ssize(told);
    doubt_as_a_whole(tracks, *chosen, contest.options, result.fit);
    std::rotate(told.begin() + of_itself, told.begin() + of_rivals, told.end());
  }
  FitOptions by_itself = contest.options;
  by_itself.start.clear();
  std::optional<TracksApart> apart;
  if (!says_explained(chosen->fit))
    apart = tracks_apart(tracks, chosen->scene, by_itself, result.fit);
  if (apart) tell_tracks_apart(*apart, result.fit);
  result.fit.comparison = table_of(rungs, chosen);
  // What explains each of the tracks by itself lacks nothing.
  result.fit.recommendation =
      sentence(rungs, *chosen, ladder, result.fit.verdict, !apart || !apart->differ);
  return result;
}

void check_compared(const data::Scene& scene, const FitOptions& options) {
  data::Scene named = to_be_compared(scene, options);
  std::set<std::string> known;
  try {
    if (named.body) known = parameters_of_any(ladder_of(named, false));
    if (may_lean_or_lie(named)) {
      named.model.name = "top";
      known.merge(parameters_of_any(ladder_of(named, false)));
    }
  } catch (const InputError&) {  // compare() says what the scene lacks
    return;
  }
  if (!known.empty()) check_names(scene.fit, known);
}

}  // namespace trochoid::fitting
