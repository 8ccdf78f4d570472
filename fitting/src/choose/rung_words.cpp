#include "choose/rung_words.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <span>
#include <utility>

#include "choose/contest.hpp"
#include "choose/retrograde.hpp"
#include "choose/terms.hpp"

namespace trochoid::fitting {
namespace {

bool likelier(const Rung* one, const Rung* other) {
  return one->bic < other->bic;
}

// The likeliest ones; the table of all models has the others.
std::string listed(std::vector<const Rung*> rungs, double bic) {
  constexpr std::size_t kMost = 3;
  std::sort(rungs.begin(), rungs.end(), likelier);
  const std::size_t shown = std::min(kMost, rungs.size());
  std::string words;
  for (const Rung* rung : std::span(rungs).first(shown))
    words +=
        fmt::format("{}{} (BIC {:+.1f})", words.empty() ? "" : ", ", rung->name, rung->bic - bic);
  if (shown < rungs.size()) words += fmt::format(" and {} more", rungs.size() - shown);
  return words;
}

// Chosen losses whose absence would leave the mean path as it began, and those it would turn round
// without all the same.
struct Turning {
  Terms needed, idle;
};

Turning what_turns(const Rung& chosen, const Ladder& ladder) {
  Turning found;
  for (const int index : chosen.terms) {
    const Term& term = ladder.terms[static_cast<std::size_t>(index)];
    if (term.last_resort || term.smooth || term.slope || term.of) continue;
    Terms fewer = chosen.terms;
    fewer.erase(index);
    const std::set<std::string> own = parameters_without(ladder, chosen.terms, fewer);
    data::Fit without = chosen.fit;
    for (data::FitParameter& parameter : without.parameters)
      if (own.contains(parameter.name)) parameter.value = 0.0;
    (retrograde_from_s(without, chosen.scene) ? found.idle : found.needed).insert(index);
  }
  // Where any one may go, they only do it together.
  if (found.needed.empty()) std::swap(found.needed, found.idle);
  return found;
}

// Which losses turn the mean path round, and whether others alone would do it as well.
std::string retrograde_sentence(const Rungs& rungs, const Rung& chosen, const Ladder& ladder) {
  const std::optional<double> from_s = retrograde_from_s(chosen.fit, chosen.scene);
  if (!from_s) return "";
  const auto term = [&](int index) { return ladder.terms[static_cast<std::size_t>(index)].name; };
  const auto joined = [&](const Terms& terms) {
    std::string words;
    for (const int index : terms) words += (words.empty() ? "" : " and ") + term(index);
    return words;
  };
  std::string alike, out, nowhere;
  for (const Rung& rung : rungs) {
    if (rung.terms.size() != 1 || &rung == &chosen || rung.fit.model == "smooth") continue;
    if (!rung.fitted) {
      nowhere += (nowhere.empty() ? "" : ", ") + term(*rung.terms.begin());
      continue;
    }
    std::string& list = rung.bic - chosen.bic < kVeryStrong ? alike : out;
    list += fmt::format("{}{} (BIC {:+.0f})", list.empty() ? "" : ", ", term(*rung.terms.begin()),
                        rung.bic - chosen.bic);
  }
  const Turning turning = what_turns(chosen, ladder);
  std::string words =
      fmt::format(" The mean path turns retrograde at t = {:.3g} s; {} explain{} it", *from_s,
                  turning.needed.empty() ? chosen.name + " without losses" : joined(turning.needed),
                  turning.needed.size() > 1 ? "" : "s");
  if (!turning.idle.empty())
    words += fmt::format(", without {} it would turn all the same", joined(turning.idle));
  if (!alike.empty()) words += ", but this track cannot tell that from " + alike;
  if (!out.empty()) words += "; ruled out as the only loss: " + out;
  if (!nowhere.empty()) words += "; no fit at all with nothing but " + nowhere;
  return words + ".";
}

}  // namespace

std::vector<const Rung*> told(const Rungs& rungs, const Rung* chosen) {
  std::vector<const Rung*> some;
  for (const Rung& rung : rungs) {
    const auto known = std::find_if(some.begin(), some.end(),
                                    [&](const Rung* other) { return other->name == rung.name; });
    if (known == some.end())
      some.push_back(&rung);
    else if (&rung == chosen || (*known != chosen && likelier(&rung, *known)))
      *known = &rung;
  }
  return some;
}

std::string sentence(const Rungs& rungs, const Rung& chosen, const Ladder& ladder,
                     data::FitVerdict verdict, bool lacks_something) {
  std::string not_tried;
  for (const std::string& term : ladder.left_out) not_tried += "; not tried: " + term;
  const bool explained = chosen.fit.converged && verdict != data::FitVerdict::doubtful;
  const std::string in_vain = !explained && lacks_something && searched_in_vain(rungs)
                                  ? " Not even all that usually acts together explains it: are "
                                    "the body's dimensions, the scale and the frame rate right?"
                                  : "";
  const std::vector<const Rung*> all = told(rungs, &chosen);
  if (!chosen.fit.converged)
    return fmt::format("none of the {} models tried explains the track; {} comes nearest{}.{}",
                       all.size(), chosen.name, not_tried, in_vain);
  const double held_back = chosen.held_back_rms_sigma;
  const std::string predicted =
      std::isfinite(held_back)
          ? fmt::format(", held-back third predicted to {:.2g} sigma", held_back)
          : "";
  std::string words = fmt::format(
      "{} {} ({} parameters, residuals {}{})", chosen.name,
      verdict == data::FitVerdict::doubtful ? "comes nearest, and does not explain the track"
                                            : "suffices",
      chosen.parameters, chosen.fit.whiteness_p >= kWhite ? "white" : "not white", predicted);
  std::vector<const Rung*> alike, worse, more;  // more: with terms beyond the chosen ones
  for (const Rung* rung : all) {
    if (!rung->fitted || rung->terms == chosen.terms) continue;
    const bool larger = has_all_terms_of(*rung, chosen);
    if (larger && (!rung->fit.converged || ended_above(*rung, chosen))) continue;
    const bool near = rung->bic - chosen.bic < kVeryStrong;
    (larger ? more : near ? alike : worse).push_back(rung);
  }
  if (!more.empty())
    words += fmt::format("; neither needed nor ruled out: {}", listed(more, chosen.bic));
  if (!alike.empty())
    words += fmt::format("; the data do not rule out {}", listed(alike, chosen.bic));
  else if (!worse.empty())
    words +=
        fmt::format("; the next best, {}, is ruled out",
                    listed({*std::min_element(worse.begin(), worse.end(), likelier)}, chosen.bic));
  return words + not_tried + "." + in_vain + retrograde_sentence(rungs, chosen, ladder);
}

}  // namespace trochoid::fitting
