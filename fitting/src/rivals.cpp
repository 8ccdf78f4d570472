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

// The chosen rung's own weight is not listed.
std::vector<Rival> rivals_of(const std::vector<Rung>& rungs, const Rung& chosen) {
  std::vector<Rival> rivals;
  double all = 1.0;
  for (const Rung& rung : rungs) {
    const bool alike = rung.fit.model == chosen.fit.model &&
                       rung.fit.covariance_names.size() > 0 &&
                       rung.fit.arcs.size() == chosen.fit.arcs.size();
    if (&rung == &chosen || !rung.fitted || !rung.fit.converged || !alike ||
        rung.bic > chosen.bic + kVeryStrong)
      continue;
    rivals.push_back({&rung, std::exp(0.5 * (chosen.aicc - rung.aicc))});
    all += rivals.back().weight;
  }
  for (Rival& rival : rivals) rival.weight /= all;
  return rivals;
}

// What a parameter is in another rung, less what it is here.
double shift_of(const data::FitParameter& here, const data::Fit& other) {
  const data::FitParameter* there = other.find(here.name);
  const double change = (there != nullptr ? there->value : 0.0) - here.value;
  return here.unit == "rad" ? std::remainder(change, 2.0 * std::numbers::pi) : change;
}

void widen(const Rival& rival, data::Fit& fit) {
  Eigen::VectorXd shift(fit.covariance.rows());
  for (Eigen::Index i = 0; i < shift.size(); ++i)
    shift[i] = shift_of(*fit.find(fit.covariance_names[static_cast<std::size_t>(i)]),
                        rival.rung->fit);
  fit.covariance += rival.weight * shift * shift.transpose();
  for (data::FitParameter& parameter : fit.parameters)
    if (parameter.status != data::ParameterStatus::fixed)
      parameter.sigma = std::hypot(parameter.sigma, std::sqrt(rival.weight) *
                                                        shift_of(parameter, rival.rung->fit));
}

}  // namespace

void allow_for_rivals(const std::vector<Rung>& rungs, const Rung& chosen, data::Fit& fit) {
  constexpr double kWorthWords = 1.3;
  const std::vector<data::FitParameter> before = fit.parameters;
  const std::vector<Rival> rivals = rivals_of(rungs, chosen);
  for (const Rival& rival : rivals) widen(rival, fit);
  double most = 1.0;
  std::string name;
  for (std::size_t i = 0; i < before.size(); ++i)
    if (before[i].sigma > 0.0 && fit.parameters[i].sigma > most * before[i].sigma) {
      most = fit.parameters[i].sigma / before[i].sigma;
      name = before[i].name;
    }
  if (most < kWorthWords) return;
  const auto strongest = std::max_element(rivals.begin(), rivals.end(), [](auto& a, auto& b) {
    return a.weight < b.weight;
  });
  fit.warnings.push_back(
      fmt::format("error bars allow for other models that are not ruled out, above all {}: that of "
                  "{} is {:.2g} times as wide",
                  strongest->rung->name, name, most));
}

}  // namespace trochoid::fitting
