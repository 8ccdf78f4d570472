#include "choose/softness.hpp"

#include <fmt/core.h>

#include <cmath>
#include <optional>

#include "judge/draft.hpp"
#include "problem/problem.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::fitting {
namespace {

constexpr const char* kCoulomb = "Coulomb's law, ";

std::optional<Draft> fit_named(std::span<const data::Track> tracks, const data::Scene& scene,
                               FitOptions options, const std::string& law) {
  if (options.progress)
    options.progress = [=, say = options.progress](const std::string& stage) { say(law + stage); };
  if (options.log)
    options.log = [=, say = options.log](const std::string& line) { say(law + line); };
  try {
    return draft_one_of_several(tracks, scene, options);
  } catch (const NumericalError&) {
    return std::nullopt;
  }
}

FitOptions going_on_from(const data::Fit& fit, FitOptions options) {
  if (auto values = values_of(fit); !values.empty()) {
    options.start = std::move(values);
    options.start_path = fit.start_path;
    options.strategy = Strategy::single;
  }
  return options;
}

// Where a search with eps free leads nowhere, one with eps held may: it has one way less to stray.
std::optional<Draft> fit_gently(std::span<const data::Track> tracks, const FitOptions& options,
                                data::Scene& scene) {
  constexpr double kGentle_m_s = 1e-3;
  const std::string law = "friction that sets in gently, ";
  const auto known = options.start.find(kSlipScale);
  scene.model.slip_regularisation_m_s = known != options.start.end() ? known->second : kGentle_m_s;
  const data::Scene held = scene;
  scene.fit.free.emplace_back(kSlipScale);
  auto fit = fit_named(tracks, scene, options, law);
  if (options.strategy == Strategy::automatic && (!fit || !fit->fit.converged))
    if (const auto near = fit_named(tracks, held, options, law); near && near->fit.converged)
      fit = fit_named(tracks, scene, going_on_from(near->fit, options), law);
  if (const data::FitParameter* found = fit ? fit->fit.find(kSlipScale) : nullptr)
    scene.model.slip_regularisation_m_s = found->value;
  return fit;
}

// From the gentle law's solution, which lies near Coulomb's where the two explain a track alike.
std::optional<Draft> fit_sharply(std::span<const data::Track> tracks, const FitOptions& options,
                                 const data::Scene& scene, const data::Fit& gentle) {
  FitOptions own = going_on_from(gentle, options);
  own.start.erase(kSlipScale);
  return fit_named(tracks, scene, std::move(own), kCoulomb);
}

// Whether so many standard deviations of eps are beyond what a parabola may hide of Coulomb's law.
// As sharp as a fit lets it be it shows nothing but that limit.
bool shows_without_asking(const Draft& gentle) {
  constexpr double kSurelySoft_squared = 10.0;  // squared
  constexpr double kByCurvature = 10.0;  // full error bars are hardly ever so many times as wide
  constexpr double kAtLimit = 1.05;
  const data::FitParameter* eps = gentle.fit.find(kSlipScale);
  const auto shows = [](const data::FitParameter* found, double times) {
    return found != nullptr && found->value > kAtLimit * kSharpest_m_s &&
           found->value * found->value >
               kSurelySoft_squared * times * times * found->sigma * found->sigma;
  };
  return shows(eps, kByCurvature) ||
         (shows(eps, 1.0) && shows(gentle.full().find(kSlipScale), 1.0));
}

// Whether Coulomb's law is kept: unless the gentle one is better by strong evidence.
bool suffices(const std::optional<Draft>& sharp, const std::optional<Draft>& gentle) {
  if (!sharp || !gentle || !usable(gentle->fit)) return sharp.has_value();
  if (sharp->fit.converged != gentle->fit.converged) return sharp->fit.converged;
  return usable(sharp->fit) && sharp->fit.bic < gentle->fit.bic + kStrong;
}

}  // namespace

bool softness_is_open(const Rung& rung) {
  return rung.scene.model.name == "sliding" && !rung.scene.model.slip_regularisation_m_s;
}

void fit_softly(std::span<const data::Track> tracks, const FitOptions& options, Rung& rung) {
  FitOptions exact = options;
  exact.start.erase(kSlipScale);
  const bool from_nothing = options.strategy == Strategy::automatic;
  const bool rolls_first = !rung.first_part.empty();
  data::Scene soft = rung.scene;
  std::optional<Draft> gentle, sharp;
  if (!(from_nothing && rolls_first)) gentle = fit_gently(tracks, options, soft);
  if (gentle && gentle->fit.converged) {
    if (!shows_without_asking(*gentle))
      sharp = fit_sharply(tracks, options, rung.scene, gentle->fit);
  } else {
    sharp = fit_named(tracks, rung.scene, exact, kCoulomb);
    const bool asks = !rolls_first || (sharp && sharp->fit.whiteness_p < kWhite);
    if (from_nothing && sharp && sharp->fit.converged && asks) {
      soft = rung.scene;
      gentle = fit_gently(tracks, going_on_from(sharp->fit, exact), soft);
    }
  }
  if (suffices(sharp, gentle)) {
    take(*std::move(sharp), rung);
    return;
  }
  if (!gentle) {  // no law led anywhere; this says why
    take(draft_one_of_several(tracks, rung.scene, exact), rung);
    return;
  }
  take(*std::move(gentle), rung);
  rung.scene = std::move(soft);
}

}  // namespace trochoid::fitting
