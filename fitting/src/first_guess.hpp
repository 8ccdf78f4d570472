#pragma once
#include <functional>
#include <map>
#include <set>
#include <span>
#include <string>

#include "trochoid/fitting/fit.hpp"

namespace trochoid::fitting {

/// Parameters a first guess for a fit of this scene may name.
[[nodiscard]] std::set<std::string> parameters_of(const data::Scene& scene);

/// @param whose  the model or models meant, as in "model 'top' has".
/// @throws InputError naming a parameter of the guess that is not `known`, and those that are.
void check_first_guess(const std::map<std::string, double>& guess, const std::string& whose,
                       const std::set<std::string>& known);

/// The scene as its model takes it: with a start for a friction that is to be found, and with what
/// priors say for what is given.
[[nodiscard]] data::Scene completed(const data::Scene& given, const FitOptions& options);

/// Which error bars are wanted: those of the values, or those by the curvature alone where
/// chi-square has a flatter side that takes several minimisations to follow.
enum class Bars { full, by_curvature };

/// fit() for one of several models that share a first guess: of what is not this model's the guess
/// is silently ignored.
[[nodiscard]] data::Fit fit_one_of_several(std::span<const data::Track> tracks,
                                           const data::Scene& scene, const FitOptions& options,
                                           Bars bars = Bars::full);

/// A fit with its error bars by curvature, as far as models are compared by it.
struct Draft {
  data::Fit fit;
  std::function<data::Fit()> full;  ///< the same with full error bars, while the tracks live
};

/// fit_one_of_several() that leaves full error bars for later.
/// @param first_part  null, or receives the values that explain the longest first part of a single
///                    arc that the search came across, if more than a fifth.
[[nodiscard]] Draft draft_one_of_several(std::span<const data::Track> tracks,
                                         const data::Scene& scene, const FitOptions& options,
                                         std::map<std::string, double>* first_part = nullptr);

/// Strategy of a sliding model whose given start is that of a body that rolls at first.
inline constexpr const char* kRollsFirst = "rolls_first";

}  // namespace trochoid::fitting
