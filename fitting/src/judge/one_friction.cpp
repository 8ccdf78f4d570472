#include "judge/one_friction.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "judge/adequacy.hpp"
#include "judge/statistics.hpp"
#include "judge/widen.hpp"
#include "observe/observed.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::fitting {
namespace {

struct Estimate {
  double value = 0.0, sigma = 0.0;
  int arc = 0;
};

// The friction of one arc alone; sigma 0 where that cannot be told.
Estimate friction_of(const Problem& problem, int arc, int friction) {
  Problem alone = single_arc(problem, arc);
  std::erase_if(alone.free, [&](const FreeParameter& parameter) {
    const std::string& name = problem.predictor->parameters()[parameter.index].name;
    // Common to all arcs, and a few of them cannot tell it from friction.
    return name == kScale || name == kTimeFactor || name == "contact_radius_m";
  });
  alone.arcs.front().camera_shifts.clear();  // likewise
  int place = -1;
  for (int i = 0; i < static_cast<int>(alone.free.size()); ++i)
    if (alone.free[i].index == friction) place = i;
  // What is known beforehand is known of all of them together: it says nothing of one.
  if (place >= 0) alone.free[place].prior.reset();
  if (place < 0 || alone.rows() <= static_cast<int>(alone.free.size())) return {};
  const Solution solution = solve(alone, alone.start());
  if (!solution.usable || !solution.converged) return {};
  try {
    const Uncertainty error = uncertainty(alone, solution.u);
    const double sigma = std::sqrt(error.covariance(place, place));
    const double value = alone.value(place, solution.u);
    if (!std::isfinite(sigma) || sigma > value) return {};
    return {value, sigma, arc};
  } catch (const NumericalError&) {
    return {};
  }
}

// The arcs' frictions differ by more than their errors: the common one is their mean, no better
// known than they agree.
void widen_friction(double times, data::Fit& fit) {
  for (data::FitParameter& parameter : fit.parameters) {
    if (parameter.name != "friction") continue;
    widen(parameter, times, fit);
    parameter.note += fmt::format("; widened {:.2g} times: the arcs differ", times);
  }
}

}  // namespace

void doubt_if_frictions_differ(const Problem& problem, data::Fit& fit) {
  const int friction = problem.predictor->index_of("friction");
  const int arcs = static_cast<int>(problem.arcs.size());
  if (problem.predictor->model_name() != "puck" || friction < 0 || arcs < 2) return;
  std::vector<Estimate> estimates;
  for (int arc = 0; arc < arcs; ++arc)
    if (const Estimate one = friction_of(problem, arc, friction); one.sigma > 0.0)
      estimates.push_back(one);
  if (estimates.size() < 2) return;
  // Those of files of their own all have the same object.
  const bool of_several_files =
      std::all_of(problem.arcs.begin(), problem.arcs.end(),
                  [&](const ArcData& arc) { return arc.object == problem.arcs[0].object; }) &&
      problem.arcs.back().track != problem.arcs.front().track;
  double weights = 0.0, sum = 0.0, chi2 = 0.0;
  std::string list;
  for (const Estimate& one : estimates) {
    weights += 1.0 / (one.sigma * one.sigma);
    sum += one.value / (one.sigma * one.sigma);
    const ArcData& arc = problem.arcs[static_cast<std::size_t>(one.arc)];
    // Two digits of the error bar and as many places of the value.
    const int places = std::clamp(1 - static_cast<int>(std::floor(std::log10(one.sigma))), 0, 12);
    const std::string whose = of_several_files ? fmt::format("track {}", arc.track + 1)
                                               : fmt::format("object {}", arc.object);
    list +=
        fmt::format("{}{:.{}f} ± {:.{}f} ({}, {:.3g} to {:.3g} s)", list.empty() ? "" : ", ",
                    one.value, places, one.sigma, places, whose, arc.t_s.front(), arc.t_s.back());
  }
  for (const Estimate& one : estimates)
    chi2 += std::pow((one.value - sum / weights) / one.sigma, 2);
  const double dof = static_cast<double>(estimates.size()) - 1.0;
  const double p = chi2_upper_tail(chi2, dof);
  constexpr double kDoubtful = 0.01, kBeyondChance = 1e-6;
  if (p <= kDoubtful) widen_friction(std::sqrt(chi2 / dof), fit);
  const std::string words = fmt::format(
      "one friction coefficient {} the {} arcs (chi-square {:.3g} for {:.0f}, p = {:.2g}); alone: "
      "{}",
      p > kDoubtful ? "explains" : "does not explain", estimates.size(), chi2, dof, p, list);
  fit.warnings.push_back(words);
  if (p > kBeyondChance || !says_explained(fit)) return;
  fit.verdict = data::FitVerdict::doubtful;
  fit.verdict_words = fmt::format(
      "the model follows the track, but does not explain it: one friction coefficient does not "
      "explain its {} arcs (p = {:.2g}); the body, the floor or the model is another",
      estimates.size(), p);
}

}  // namespace trochoid::fitting
