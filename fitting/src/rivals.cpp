#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "rung.hpp"

namespace trochoid::fitting {
namespace {

struct Rival {
  const Rung* rung = nullptr;
  double weight = 0.0;  // by AICc, of all that are not ruled out together 1
};

// Of the same law, and not ruled out.
bool in_question(const Rung& rung, const Rung& chosen) {
  return &rung != &chosen && rung.fitted && rung.fit.converged &&
         rung.fit.model == chosen.fit.model && rung.fit.arcs.size() == chosen.fit.arcs.size() &&
         rung.bic <= chosen.bic + kVeryStrong;
}

// The chosen rung's own weight is not listed.
std::vector<Rival> rivals_of(const std::vector<Rung>& rungs, const Rung& chosen) {
  std::vector<Rival> rivals;
  double all = 1.0;
  for (const Rung& rung : rungs) {
    if (!in_question(rung, chosen) || has_all_terms_of(rung, chosen)) continue;
    rivals.push_back({&rung, std::exp(0.5 * (chosen.aicc - rung.aicc))});
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

void widen(const Rival& rival, data::Fit& fit) {
  Eigen::VectorXd shift(fit.covariance.rows());
  for (Eigen::Index i = 0; i < shift.size(); ++i) {
    const std::string& name = fit.covariance_names[static_cast<std::size_t>(i)];
    shift[i] = shift_of(*fit.find(name), rival.rung->fit);
  }
  fit.covariance += rival.weight * shift * shift.transpose();
  const double share = std::sqrt(rival.weight);
  for (data::FitParameter& parameter : fit.parameters)
    if (parameter.status != data::ParameterStatus::fixed)
      parameter.sigma = std::hypot(parameter.sigma, share * shift_of(parameter, rival.rung->fit));
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
  for (const Rival& rival : rivals) widen(rival, fit);
  warn_of_rivals(rivals, before, fit);
  warn_of_larger_ones(rungs, chosen, fit);
}

}  // namespace trochoid::fitting
