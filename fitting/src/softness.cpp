#include "softness.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "first_guess.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::fitting {
namespace {

constexpr double kGentle_m_s = 1e-3;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Trial {
  double log_eps = 0.0;
  data::Fit fit;
};

// The rung's fit with one softness, eps = 0: Coulomb's law; from another fit's values if given.
std::optional<data::Fit> fit_with(std::span<const data::Track> tracks, const FitOptions& options,
                                  const Rung& rung, double eps_m_s, const data::Fit* from) {
  data::Scene scene = rung.scene;
  scene.model.slip_regularisation_m_s = eps_m_s;
  FitOptions own = options;
  own.strategy = from != nullptr ? "single" : "auto";
  const std::string law =
      eps_m_s > 0.0 ? fmt::format("slip over {:.2g} m/s, ", eps_m_s) : "Coulomb's law, ";
  if (options.progress)
    own.progress = [&](const std::string& stage) { options.progress(law + stage); };
  if (options.log) own.log = [&](const std::string& line) { options.log(law + line); };
  if (from != nullptr) own.start = values_of(*from);
  try {
    data::Fit result = fit_one_of_several(tracks, scene, own);
    if (usable(result)) return result;
  } catch (const NumericalError&) {
  }
  return std::nullopt;
}

// Follows the softness from trial to trial while that helps and BIC may still fall below
// `worth_it`: near its least BIC is a parabola, and no further trial gains more than the last one.
// Best last but one, or last if the sharpest law was reached.
void follow(std::span<const data::Track> tracks, const FitOptions& options, const Rung& rung,
            double factor, int most, double worth_it, std::vector<Trial>& trials) {
  for (int i = 0; i < most; ++i) {
    const Trial& last = trials.back();
    const double gain = i > 0 ? trials[trials.size() - 2].fit.bic - last.fit.bic : kInfinity;
    if (last.fit.bic - (most - i) * gain > worth_it) return;
    const double log_eps = last.log_eps + std::log(factor);
    auto next = fit_with(tracks, options, rung, std::exp(log_eps), &last.fit);
    if (!next) return;
    const bool worse = next->bic > last.fit.bic;
    trials.push_back({log_eps, std::move(*next)});
    if (worse) return;
  }
}

// Of the parabola of BIC in log eps through the best trial and its neighbours.
struct Vertex {
  double log_eps = 0.0, curvature = 0.0;
  double gain = 0.0;  // of BIC over the best trial
};

std::optional<Vertex> vertex_of(const std::vector<Trial>& ascending, std::size_t best) {
  if (best == 0 || best + 1 >= ascending.size()) return std::nullopt;
  const Trial &a = ascending[best - 1], &b = ascending[best], &c = ascending[best + 1];
  const double left = (b.fit.bic - a.fit.bic) / (b.log_eps - a.log_eps);
  const double right = (c.fit.bic - b.fit.bic) / (c.log_eps - b.log_eps);
  const double curvature = 2.0 * (right - left) / (c.log_eps - a.log_eps);
  if (!(curvature > 0.0)) return std::nullopt;
  const double middle = 0.5 * (a.log_eps + b.log_eps);
  const double log_eps = std::clamp(middle - left / curvature, a.log_eps, c.log_eps);
  return Vertex{log_eps, curvature, 0.5 * curvature * std::pow(log_eps - b.log_eps, 2)};
}

std::size_t best_of(std::vector<Trial>& trials) {
  std::sort(trials.begin(), trials.end(),
            [](const Trial& a, const Trial& b) { return a.log_eps < b.log_eps; });
  const auto best =
      std::min_element(trials.begin(), trials.end(),
                       [](const auto& a, const auto& b) { return a.fit.bic < b.fit.bic; });
  return static_cast<std::size_t>(best - trials.begin());
}

// What the parameters change by when the softness is off by its standard deviation.
void widen(const Trial& best, const Trial& other, double sigma_log, data::Fit& fit) {
  const double share = sigma_log / (other.log_eps - best.log_eps);
  Eigen::VectorXd shift = Eigen::VectorXd::Zero(fit.covariance.rows());
  for (Eigen::Index i = 0; i < shift.size(); ++i) {
    const std::string& name = fit.covariance_names[static_cast<std::size_t>(i)];
    const data::FitParameter *here = best.fit.find(name), *there = other.fit.find(name);
    if (here == nullptr || there == nullptr) continue;
    const double change = there->value - here->value;
    shift[i] = share * (here->unit == "rad" ? std::remainder(change, 2.0 * M_PI) : change);
  }
  fit.covariance += shift * shift.transpose();
  for (data::FitParameter& parameter : fit.parameters) {
    const auto name =
        std::find(fit.covariance_names.begin(), fit.covariance_names.end(), parameter.name);
    if (name != fit.covariance_names.end())
      parameter.sigma = std::hypot(parameter.sigma, shift[name - fit.covariance_names.begin()]);
  }
}

}  // namespace

bool softness_is_open(const Rung& rung) {
  return rung.scene.model.name == "sliding" && !rung.scene.model.slip_regularisation_m_s;
}

void fit_softly(std::span<const data::Track> tracks, const FitOptions& options, Rung& rung,
                const Rung* above) {
  constexpr double kFactor = 0.5;
  constexpr int kSharper = 4, kSofter = 2;
  const double gentle_m_s =
      above != nullptr ? *above->scene.model.slip_regularisation_m_s : kGentle_m_s;
  auto first =
      fit_with(tracks, options, rung, gentle_m_s, above != nullptr ? &above->fit : nullptr);
  if (!first) {
    rung.fit = fit_one_of_several(tracks, rung.scene, options);
    return;
  }
  if (!first->converged) {  // a path that is not the body's has no softness
    rung.fit = std::move(*first);
    rung.scene.model.slip_regularisation_m_s = gentle_m_s;
    return;
  }
  // Beyond that a smaller model is ruled out, whatever the softness.
  const double worth_it = above != nullptr ? above->bic + kVeryStrong : kInfinity;
  std::vector<Trial> trials{{std::log(gentle_m_s), std::move(*first)}};
  follow(tracks, options, rung, kFactor, kSharper, worth_it, trials);
  std::size_t best = best_of(trials);
  if (best + 1 == trials.size() && trials.size() <= 2) {  // the gentlest so far
    std::vector<Trial> softer{trials.back()};
    follow(tracks, options, rung, 1.0 / kFactor, kSofter, worth_it, softer);
    trials.insert(trials.end(), softer.begin() + 1, softer.end());
    best = best_of(trials);
  }
  const auto vertex = vertex_of(trials, best);
  if (vertex && trials[best].fit.bic - vertex->gain < worth_it) {
    if (auto refined =
            fit_with(tracks, options, rung, std::exp(vertex->log_eps), &trials[best].fit))
      trials.push_back({vertex->log_eps, std::move(*refined)});
    best = best_of(trials);
  }
  const double price = std::log(static_cast<double>(trials[best].fit.dof) +
                                static_cast<double>(trials[best].fit.covariance_names.size()));
  const double allowed = trials[best].fit.bic + price + kStrong;
  // Whether it shows at all: against Coulomb's law, unless a sharper law than the best does worse.
  if (trials.front().fit.bic < std::min(allowed, worth_it))
    if (auto sharp = fit_with(tracks, options, rung, 0.0, &trials.front().fit);
        sharp && sharp->bic < allowed) {
      rung.fit = std::move(*sharp);
      return;
    }
  const double eps_m_s = std::exp(trials[best].log_eps);
  data::Fit chosen = trials[best].fit;
  chosen.bic += price;
  chosen.aicc += 2.0;
  std::string known;
  if (const auto least = vertex_of(trials, best)) {
    const double sigma_log = std::sqrt(2.0 / least->curvature);
    widen(trials[best], trials[best + 1], sigma_log, chosen);
    known = fmt::format(" +- {:.2g}", sigma_log * eps_m_s);
  }
  chosen.warnings.push_back(fmt::format(
      "friction sets in over a slip of {:.3g}{} m/s (slip_regularisation_m_s): Coulomb's "
      "law, which sets in at once, explains the track less well",
      eps_m_s, known));
  rung.fit = std::move(chosen);
  rung.scene.model.slip_regularisation_m_s = eps_m_s;
  rung.softness_fitted = true;
}

}  // namespace trochoid::fitting
