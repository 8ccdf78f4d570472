#include "softness.hpp"

#include <fmt/core.h>

#include <cmath>
#include <optional>

#include "first_guess.hpp"
#include "problem.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::fitting {
namespace {

constexpr const char* kCoulomb = "Coulomb's law, ";

std::optional<data::Fit> fit_named(std::span<const data::Track> tracks, const data::Scene& scene,
                                   FitOptions options, const std::string& law) {
  if (options.progress)
    options.progress = [=, say = options.progress](const std::string& stage) { say(law + stage); };
  if (options.log)
    options.log = [=, say = options.log](const std::string& line) { say(law + line); };
  try {
    data::Fit result = fit_one_of_several(tracks, scene, options);
    if (usable(result)) return result;
  } catch (const NumericalError&) {
  }
  return std::nullopt;
}

FitOptions going_on_from(const data::Fit& fit, FitOptions options) {
  if (auto values = values_of(fit); !values.empty()) {
    options.start = std::move(values);
    options.strategy = "single";
  }
  return options;
}

// Where a search with eps free leads nowhere, one with eps held may: it has one way less to stray.
std::optional<data::Fit> fit_gently(std::span<const data::Track> tracks, const FitOptions& options,
                                    data::Scene& scene) {
  constexpr double kGentle_m_s = 1e-3;
  const std::string law = "friction that sets in gently, ";
  const auto known = options.start.find(kSlipScale);
  scene.model.slip_regularisation_m_s = known != options.start.end() ? known->second : kGentle_m_s;
  const data::Scene held = scene;
  scene.fit.free.emplace_back(kSlipScale);
  auto fit = fit_named(tracks, scene, options, law);
  if (options.strategy == "auto" && (!fit || !fit->converged))
    if (const auto near = fit_named(tracks, held, options, law); near && near->converged)
      fit = fit_named(tracks, scene, going_on_from(*near, options), law);
  if (const data::FitParameter* found = fit ? fit->find(kSlipScale) : nullptr)
    scene.model.slip_regularisation_m_s = found->value;
  return fit;
}

// From the gentle law's solution, which lies near Coulomb's where the two explain a track alike.
std::optional<data::Fit> fit_sharply(std::span<const data::Track> tracks, const FitOptions& options,
                                     const data::Scene& scene, const data::Fit& gentle) {
  FitOptions own = going_on_from(gentle, options);
  own.start.erase(kSlipScale);
  return fit_named(tracks, scene, std::move(own), kCoulomb);
}

// Whether so many standard deviations of eps are beyond what a parabola may hide of Coulomb's law.
// As sharp as a fit lets it be it shows nothing but that limit.
bool shows_without_asking(const data::Fit& gentle) {
  constexpr double kSurely = 10.0;  // squared
  constexpr double kAtLimit = 1.05;
  const data::FitParameter* eps = gentle.find(kSlipScale);
  return eps != nullptr && eps->value > kAtLimit * kSharpest_m_s &&
         eps->value * eps->value > kSurely * eps->sigma * eps->sigma;
}

}  // namespace

bool softness_is_open(const Rung& rung) {
  return rung.scene.model.name == "sliding" && !rung.scene.model.slip_regularisation_m_s;
}

void fit_softly(std::span<const data::Track> tracks, const FitOptions& options, Rung& rung) {
  FitOptions exact = options;
  exact.start.erase(kSlipScale);
  data::Scene soft = rung.scene;
  auto gentle = fit_gently(tracks, options, soft);
  std::optional<data::Fit> sharp;
  if (gentle && gentle->converged) {
    if (!shows_without_asking(*gentle)) sharp = fit_sharply(tracks, options, rung.scene, *gentle);
  } else if (options.strategy == "auto") {
    // The gentle law is dear to follow; the exact one may get where the search for it ran out.
    sharp = fit_named(tracks, rung.scene, exact, kCoulomb);
    if (sharp && sharp->converged) {
      soft = rung.scene;
      gentle = fit_gently(tracks, going_on_from(*sharp, exact), soft);
    }
  }
  if (sharp &&
      (!gentle || (sharp->converged == gentle->converged ? sharp->bic < gentle->bic + kStrong
                                                         : sharp->converged))) {
    rung.fit = std::move(*sharp);
    return;
  }
  if (!gentle) {
    rung.fit = fit_one_of_several(tracks, rung.scene, exact);
    return;
  }
  rung.fit = std::move(*gentle);
  rung.scene = std::move(soft);
}

}  // namespace trochoid::fitting
