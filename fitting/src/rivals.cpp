#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "rung.hpp"

namespace trochoid::fitting {
namespace {

struct Rival {
  const Rung* rung = nullptr;
  double weight = 0.0;  // by AICc, of all that are not ruled out together 1
  bool larger = false;  // has further terms beside all of the chosen rung's
};

// Of the same law, and not ruled out.
bool in_question(const Rung& rung, const Rung& chosen) {
  return &rung != &chosen && rung.fitted && rung.fit.converged &&
         rung.fit.model == chosen.fit.model && rung.fit.arcs.size() == chosen.fit.arcs.size() &&
         rung.bic <= chosen.bic + kVeryStrong;
}

// The chosen rung's own weight is not listed. One with further terms is a rival where BIC's
// evidence against it is not strong, by the odds that BIC gives it: it was left out for being
// larger, not for being wrong. Not so where residuals hang together: a further term may then only
// follow the tracker's errors.
std::vector<Rival> rivals_of(const std::vector<Rung>& rungs, const Rung& chosen) {
  const double most = chosen.fit.whiteness_p < kWhite ? -std::numeric_limits<double>::infinity()
                                                      : chosen.bic + kStrong;
  std::vector<Rival> rivals;
  double all = 1.0;
  for (const Rung& rung : rungs) {
    const bool larger = has_all_terms_of(rung, chosen);
    if (!in_question(rung, chosen) || (larger && rung.bic > most)) continue;
    const double lead = larger ? chosen.bic - rung.bic : chosen.aicc - rung.aicc;
    rivals.push_back({&rung, std::exp(0.5 * lead), larger});
    all += rivals.back().weight;
  }
  for (Rival& rival : rivals) rival.weight /= all;
  return rivals;
}

// What a parameter is in another rung, less what it is here. A loss that is not there is none.
double shift_of(const data::FitParameter& here, const data::Fit& other) {
  const data::FitParameter* there = other.find(here.name);
  const double change = (there != nullptr ? there->value : 0.0) - here.value;
  return here.unit == "rad" ? std::remainder(change, 2.0 * std::numbers::pi) : change;
}

// Variance of a parameter in a rung with further terms beyond that in the chosen one, which does
// not allow for those terms.
double further_variance(const Rival& rival, const std::string& name, const data::Fit& chosen) {
  const data::FitParameter* there = rival.larger ? rival.rung->fit.find(name) : nullptr;
  if (there == nullptr || !std::isfinite(there->sigma)) return 0.0;
  const double here = chosen.find(name)->sigma;
  return std::max(0.0, there->sigma * there->sigma - here * here);
}

void widen(const Rival& rival, const data::Fit& chosen, data::Fit& fit) {
  Eigen::VectorXd shift(fit.covariance.rows());
  for (Eigen::Index i = 0; i < shift.size(); ++i) {
    const std::string& name = fit.covariance_names[static_cast<std::size_t>(i)];
    shift[i] = shift_of(*fit.find(name), rival.rung->fit);
  }
  fit.covariance += rival.weight * shift * shift.transpose();
  for (Eigen::Index i = 0; i < shift.size(); ++i)
    fit.covariance(i, i) +=
        rival.weight *
        further_variance(rival, fit.covariance_names[static_cast<std::size_t>(i)], chosen);
  for (data::FitParameter& parameter : fit.parameters)
    if (parameter.status != data::ParameterStatus::fixed)
      parameter.sigma =
          std::sqrt(std::pow(parameter.sigma, 2) +
                    rival.weight * (std::pow(shift_of(parameter, rival.rung->fit), 2) +
                                    further_variance(rival, parameter.name, chosen)));
}

void warn_of_rivals(const std::vector<Rival>& rivals, const std::vector<data::FitParameter>& before,
                    data::Fit& fit) {
  constexpr double kWorthWords = 1.3;
  double most = kWorthWords;
  std::string name;
  for (std::size_t i = 0; i < before.size(); ++i)
    if (before[i].sigma > 0.0 && fit.parameters[i].sigma > most * before[i].sigma) {
      most = fit.parameters[i].sigma / before[i].sigma;
      name = before[i].name;
    }
  if (name.empty()) return;
  // Of that parameter; a likelier rival may leave it where it is.
  const auto share = [&](const Rival& rival) {
    return rival.weight * std::pow(shift_of(*fit.find(name), rival.rung->fit), 2);
  };
  const auto strongest =
      std::max_element(rivals.begin(), rivals.end(),
                       [&](const Rival& a, const Rival& b) { return share(a) < share(b); });
  fit.warnings.push_back(
      fmt::format("error bars allow for other models that explain the track as well, above all {}: "
                  "that of {} is {:.2g} times as wide",
                  strongest->rung->name, name, most));
}

// A loss too small to be needed may still move the others.
void warn_of_larger_ones(const std::vector<Rung>& rungs, const Rung& chosen, data::Fit& fit) {
  constexpr double kFar = 3.0;  // error bars
  const Rung* likeliest = nullptr;
  for (const Rung& rung : rungs)
    if (in_question(rung, chosen) && has_all_terms_of(rung, chosen) && rung.aicc < chosen.aicc &&
        (likeliest == nullptr || rung.aicc < likeliest->aicc))
      likeliest = &rung;
  if (likeliest == nullptr) return;
  const data::FitParameter* moved = nullptr;
  double most = kFar;
  for (const data::FitParameter& parameter : fit.parameters) {
    // Where Coulomb's law does beside one loss more, the speed over which friction sets in is gone.
    if (parameter.status != data::ParameterStatus::free ||
        likeliest->fit.find(parameter.name) == nullptr)
      continue;
    const double bars = std::abs(shift_of(parameter, likeliest->fit)) / parameter.sigma;
    if (!(bars > most)) continue;
    most = bars;
    moved = &parameter;
  }
  if (moved == nullptr) return;
  const data::FitParameter* there = likeliest->fit.find(moved->name);
  fit.warnings.push_back(fmt::format(
      "{} is neither needed nor ruled out: with it, {} would be {:.4g} +- {:.2g}, {:.2g} of its "
      "error bars from here",
      likeliest->name, moved->name, there->value, there->sigma, most));
}

}  // namespace

void allow_for_rivals(const std::vector<Rung>& rungs, const Rung& chosen, data::Fit& fit) {
  const std::vector<data::FitParameter> before = fit.parameters;
  const std::vector<Rival> rivals = rivals_of(rungs, chosen);
  const data::Fit chosen_fit = fit;
  for (const Rival& rival : rivals) widen(rival, chosen_fit, fit);
  warn_of_rivals(rivals, before, fit);
  warn_of_larger_ones(rungs, chosen, fit);
}

}  // namespace trochoid::fitting
