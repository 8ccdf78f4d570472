#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "choose/rung.hpp"
#include "observe/angles.hpp"
#include "problem/problem.hpp"
#include "trochoid/data/angle.hpp"

namespace trochoid::fitting {
namespace {

constexpr const char* kOfAttitude[]{"theta_rad", "phi_rad", "w1_rad_s", "w3_rad_s"};

// Which error bars a rival widens as far as it goes; the others within_bounds().
enum class Unbounded { all, coefficients, none };

struct Rival {
  const Rung* rung = nullptr;
  double weight = 0.0;  // of all that are not ruled out and of the chosen rung together 1
  Unbounded unbounded = Unbounded::all;
  // Of the chosen rung's parameters: how far off they are in this one, and by how much larger their
  // variances are.
  Eigen::VectorXd shift{}, further{};
};

// Of the same law, and not ruled out. One with further terms is left out for being larger, not for
// being wrong: what it fits beyond is all that its terms promise where they do nothing.
bool in_question(const Rung& rung, const Rung& chosen) {
  if (&rung == &chosen || !rung.fitted || !rung.fit.converged ||
      rung.fit.model != chosen.fit.model || rung.fit.arcs.size() != chosen.fit.arcs.size())
    return false;
  const bool larger = rung.terms != chosen.terms && has_all_terms_of(rung, chosen);
  return larger ? !ended_above(rung, chosen) : rung.bic <= chosen.bic + kVeryStrong;
}

// Whether a rung has terms beyond the chosen one's, all of them among these.
bool adds_only(const Terms& these, const Rung& rung, const Rung& chosen) {
  return rung.terms != chosen.terms &&
         std::all_of(rung.terms.begin(), rung.terms.end(),
                     [&](int term) { return these.contains(term) || chosen.terms.contains(term); });
}

// The usual terms, and the other laws by which those of the chosen rung may go as well.
Terms likely(const RivalGrounds& grounds) {
  Terms terms = grounds.usual;
  terms.insert(grounds.other_laws.begin(), grounds.other_laws.end());
  return terms;
}

// Whether a loss that acts by the chosen rung is not shown to by a rung with further terms: to
// which of them it belongs is open then, and the chosen rung's bar would be of one loss in the
// place of several.
bool leaves_open(const Rung& rung, const Rung& chosen, const std::set<std::string>& losses) {
  constexpr double kActs = 2.0, kShown = 5.0;  // error bars
  const auto beyond = [](const data::FitParameter* loss, double bars) {
    return loss != nullptr && std::abs(loss->value) >= bars * loss->sigma;
  };
  return std::any_of(losses.begin(), losses.end(), [&](const std::string& name) {
    return beyond(chosen.fit.find(name), kActs) && !beyond(rung.fit.find(name), kShown);
  });
}

// How a rung stands to the chosen one.
struct Standing {
  Standing(const Rung& rung, const Rung& chosen, const RivalGrounds& grounds)
      : larger(has_all_terms_of(rung, chosen)),
        too_large(larger && rung.bic > chosen.bic + kStrong),
        acts(adds_only(likely(grounds), rung, chosen)),
        open(larger && adds_only(grounds.usual, rung, chosen) &&
             leaves_open(rung, chosen, grounds.losses)),
        independent(leaves_independent(chosen, grounds.inflation)),
        slips(chosen.rolls_at_first && !rung.rolls_at_first && rung.terms == chosen.terms) {}
  bool larger;       // has all of the chosen rung's terms, and further ones or another minimum
  bool too_large;    // there is strong evidence against it, for that
  bool acts;         // its further terms are usual ones, or other laws of such
  bool open;         // usual ones, and nothing beside them tells the chosen losses from them
  bool independent;  // what the chosen rung leaves hangs together next to nothing
  bool slips;        // the chosen rung, but that the body may slip at first
};

// Where residuals hang together a further term may only follow the tracker's errors; but a rung
// with one counts where BIC speaks for it, though not strongly, all the same, or where the term is
// usual and which loss acts is open. A velocity of its own at the start is no further term.
bool counts(const Rung& rung, const Rung& chosen, const Standing& standing) {
  return in_question(rung, chosen) && (!standing.larger || standing.independent || standing.open ||
                                       standing.slips || rung.bic < chosen.bic);
}

// By how much a rung is the likelier one, as a difference of -2 ln likelihood. By BIC, what usually
// acts would weigh less than where the evidence against it is stronger. Where it is asked only
// which of them does what, that usual losses act is no assumption that would have to be paid for.
double lead_of(const Rung& rung, const Rung& chosen, const Standing& standing) {
  const double by_aicc = chosen.aicc - rung.aicc;
  if (standing.open) return by_aicc + 2.0 * (rung.parameters - chosen.parameters);
  const bool by_bic = standing.larger && !standing.too_large && !standing.acts;
  return by_bic ? chosen.bic - rung.bic : by_aicc;
}

// Rivals with a loss of their own may widen an error bar up to a bound; beyond it the bar would
// speak of the assumed losses rather than of the track, and a note tells the rest. Losses that act
// on nearly every body widen without bound: that they are there is no assumption. Where residuals
// hang together they do so for coefficients alone: how the body moves is seen whichever of them
// acts.
Unbounded unbounded(const Standing& standing) {
  if (standing.too_large && !standing.acts) return Unbounded::none;
  return standing.open && !standing.independent ? Unbounded::coefficients : Unbounded::all;
}

// Squared distance in error bars of what says how a body of two faces stands and turns in an arc.
double distance(const data::Fit& here, const data::Fit& there, const std::string& arc) {
  double sum = 0.0;
  for (const char* name : kOfAttitude) {
    const data::FitParameter &a = *here.find(name + arc), &b = *there.find(name + arc);
    const double off = b.value - a.value;
    const double bars = (a.unit == "rad" ? data::wrapped(off) : off) / a.sigma;
    sum += std::isfinite(bars) ? bars * bars : 0.0;
  }
  return sum;
}

// Another rung's fit with its attitudes named by the same of the two faces as the chosen one's:
// about an upright body each rung takes its own, and the motion is the same.
data::Fit named_alike(const data::Fit& here, data::Fit there) {
  for (std::size_t i = 0; i < here.arcs.size(); ++i) {
    const std::string arc = i > 0 ? fmt::format("@{}", i) : "";
    const auto has = [&](const data::Fit& fit, const std::string& name) {
      const auto is_it = [&](const auto& parameter) { return parameter.name == name + arc; };
      return std::any_of(fit.parameters.begin(), fit.parameters.end(), is_it);
    };
    const auto has_all = [&](const data::Fit& fit) {
      return std::all_of(std::begin(kOfAttitude), std::end(kOfAttitude),
                         [&](const char* name) { return has(fit, name); });
    };
    if (!has_all(here) || !has_all(there) || has(here, "psi_rad")) continue;
    data::Fit turned = there;
    for (data::FitParameter& parameter : turned.parameters) {
      if (parameter.name == "theta_rad" + arc) parameter.value = data::kPi - parameter.value;
      if (parameter.name == "phi_rad" + arc) parameter.value += data::kPi;
      if (parameter.name == "w1_rad_s" + arc || parameter.name == "w3_rad_s" + arc)
        parameter.value = -parameter.value;
    }
    if (distance(here, turned, arc) < distance(here, there, arc)) there = std::move(turned);
  }
  return there;
}

// What a parameter is in another rung, less what it is here. A loss that is not there is none; of
// the velocity of the centre a rung without it says nothing.
double shift_of(const data::FitParameter& here, const data::Fit& other) {
  const data::FitParameter* there = other.find(here.name);
  const bool loss = here.name != "vx_m_s" && here.name != "vy_m_s";
  if (there == nullptr && !loss) return 0.0;
  const double change = (there != nullptr ? there->value : 0.0) - here.value;
  return here.unit == "rad" ? data::wrapped(change) : change;
}

// Variance of a parameter in a rung with further terms beyond that in the chosen one, which does
// not allow for those terms; of both by curvature, which does not know that no loss is negative:
// one can only give way to the others until nothing is left of it.
double further_variance(const data::Fit& larger, const data::Fit& chosen, const std::string& name,
                        const std::set<std::string>& losses) {
  const data::FitParameter *here = chosen.find(name), *there = larger.find(name);
  if (here == nullptr || there == nullptr || !std::isfinite(there->sigma)) return 0.0;
  const double further = there->sigma * there->sigma - here->sigma * here->sigma;
  const double all = std::max(std::abs(here->value), std::abs(there->value));
  const bool never_negative = losses.contains(name) || name == "friction";
  return std::max(0.0, never_negative ? std::min(further, all * all) : further);
}

// Those that may be right as well, and those against which there is strong evidence, but only for
// being larger. The chosen rung's own weight is not listed.
// @param parameters  of the chosen rung, whose error bars are to allow for them.
std::vector<Rival> rivals_of(const Rungs& rungs, const Rung& chosen, const RivalGrounds& grounds,
                             const std::vector<data::FitParameter>& parameters) {
  const auto count = static_cast<Eigen::Index>(parameters.size());
  std::vector<Rival> rivals;
  double all = 1.0;
  for (const Rung& rung : rungs) {
    const Standing standing(rung, chosen, grounds);
    if (!counts(rung, chosen, standing)) continue;
    Rival& rival = rivals.emplace_back();
    rival.rung = &rung;
    rival.weight = std::exp(0.5 * lead_of(rung, chosen, standing));
    rival.unbounded = unbounded(standing);
    rival.shift = rival.further = Eigen::VectorXd::Zero(count);
    const data::Fit other = named_alike(chosen.fit, rung.fit);
    for (Eigen::Index i = 0; i < count; ++i) {
      const data::FitParameter& here = parameters[static_cast<std::size_t>(i)];
      if (here.status == data::ParameterStatus::fixed) continue;
      rival.shift[i] = shift_of(here, other);
      if (standing.larger)
        rival.further[i] = further_variance(rung.fit, chosen.fit, here.name, grounds.losses);
    }
    all += rival.weight;
  }
  for (Rival& rival : rivals) rival.weight /= all;
  return rivals;
}

// What rivals that leave the same without a bound add to the covariance of all parameters.
Eigen::MatrixXd spread_of(const std::vector<Rival>& rivals, Unbounded unbounded,
                          std::size_t count) {
  const auto size = static_cast<Eigen::Index>(count);
  Eigen::MatrixXd spread = Eigen::MatrixXd::Zero(size, size);
  for (const Rival& rival : rivals) {
    if (rival.unbounded != unbounded) continue;
    spread += rival.weight * rival.shift * rival.shift.transpose();
    spread.diagonal() += rival.weight * rival.further;
  }
  return spread;
}

// The same with error bars no wider than a bound.
// @param unbounded  parameters without one.
Eigen::MatrixXd within_bounds(const std::vector<data::FitParameter>& parameters,
                              const std::set<std::string>& unbounded,
                              const Eigen::MatrixXd& spread) {
  constexpr double kWidest = 2.5;
  Eigen::VectorXd share(spread.rows());
  for (Eigen::Index i = 0; i < share.size(); ++i) {
    const data::FitParameter& parameter = parameters[static_cast<std::size_t>(i)];
    const double most = parameter.sigma * std::sqrt(kWidest * kWidest - 1.0);
    const bool beyond = spread(i, i) > most * most && !unbounded.contains(parameter.name);
    share[i] = beyond ? most / std::sqrt(spread(i, i)) : 1.0;
  }
  return share.asDiagonal() * spread * share.asDiagonal();
}

void widen(const Eigen::MatrixXd& spread, data::Fit& fit) {
  std::vector<Eigen::Index> places;  // among the parameters, of those in the covariance
  for (const std::string& name : fit.covariance_names)
    places.push_back(fit.find(name) - fit.parameters.data());
  fit.covariance += spread(places, places);
  for (std::size_t i = 0; i < fit.parameters.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    double& sigma = fit.parameters[i].sigma;
    if (spread(at, at) > 0.0) sigma = std::sqrt(sigma * sigma + spread(at, at));
  }
}

void warn_of_rivals(const std::vector<Rival>& rivals, const std::vector<data::FitParameter>& before,
                    data::Fit& fit) {
  constexpr double kWorthWords = 1.3;
  double most = kWorthWords;
  std::optional<std::size_t> widened;
  for (std::size_t i = 0; i < before.size(); ++i)
    if (before[i].sigma > 0.0 && fit.parameters[i].sigma > most * before[i].sigma) {
      most = fit.parameters[i].sigma / before[i].sigma;
      widened = i;
    }
  if (!widened) return;
  // Of that parameter; a likelier rival may leave it where it is.
  const auto share = [at = static_cast<Eigen::Index>(*widened)](const Rival& rival) {
    return rival.weight * (rival.shift[at] * rival.shift[at] + rival.further[at]);
  };
  const auto strongest =
      std::max_element(rivals.begin(), rivals.end(),
                       [&](const Rival& a, const Rival& b) { return share(a) < share(b); });
  fit.warnings.push_back(
      fmt::format("error bars allow for other models that explain the track as well, above all {}: "
                  "that of {} is {:.2g} times as wide",
                  strongest->rung->name, before[*widened].name, most));
}

// A loss too small to be needed may still move the others, or where none of it fits best leave them
// open: the one that does so most.
void warn_of_larger_ones(const Rungs& rungs, const Rung& chosen, data::Fit& fit) {
  constexpr double kFar = 3.0;  // error bars
  const Rung* moving = nullptr;
  const data::FitParameter* moved = nullptr;
  data::FitParameter there;
  double most = kFar, shifted = 0.0;
  for (const Rung& rung : rungs) {
    if (!in_question(rung, chosen) || !has_all_terms_of(rung, chosen)) continue;
    const data::Fit named = named_alike(fit, rung.fit);
    for (const data::FitParameter& parameter : fit.parameters) {
      // Where Coulomb's law does beside one loss more, the speed over which friction sets in is
      // gone.
      const data::FitParameter* other = named.find(parameter.name);
      if (parameter.status != data::ParameterStatus::free || other == nullptr) continue;
      const double shift = std::abs(shift_of(parameter, named));
      const double bars = std::max(shift, other->sigma) / parameter.sigma;
      if (!(bars > most)) continue;
      most = bars, moving = &rung, moved = &parameter, there = *other, shifted = shift;
    }
  }
  if (moving == nullptr) return;
  const bool open = !std::isfinite(there.sigma);
  const double shift = shifted / moved->sigma;
  fit.warnings.push_back(fmt::format(
      "{} is neither needed nor ruled out: with it, {} would {}; the {:.4g} ± {:.2g} given here "
      "is {}",
      moving->name, moved->name,
      open ? "not be determined" : fmt::format("be {:.4g} ± {:.2g}", there.value, there.sigma),
      moved->value, moved->sigma,
      !open && shift > kFar ? fmt::format("away from that by {:.2g} times its own error bar", shift)
                            : "what holds without it"));
}

}  // namespace

void allow_for_rivals(const Rungs& rungs, const Rung& chosen, data::Fit& fit,
                      const RivalGrounds& grounds) {
  const std::vector<data::FitParameter> before = fit.parameters;
  const std::vector<Rival> rivals = rivals_of(rungs, chosen, grounds, before);
  const auto spread = [&](Unbounded what) { return spread_of(rivals, what, before.size()); };
  std::set<std::string> coefficients = grounds.losses;
  coefficients.merge(std::set<std::string>{"friction", kSlipScale});
  const Eigen::MatrixXd bounded = within_bounds(before, {}, spread(Unbounded::none));
  widen(spread(Unbounded::all) +
            within_bounds(before, coefficients, spread(Unbounded::coefficients) + bounded),
        fit);
  warn_of_rivals(rivals, before, fit);
  warn_of_larger_ones(rungs, chosen, fit);
}

}  // namespace trochoid::fitting
