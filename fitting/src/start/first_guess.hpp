#pragma once
#include <array>
#include <functional>
#include <map>
#include <set>
#include <span>
#include <string>

#include "observe/observations.hpp"
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

/// How finely a fit had to be integrated in the end, and the noise it found. A fit of a like model
/// that starts from its solution starts with these as well: integrated more coarsely, the path of a
/// body that slips and sticks has its minimum elsewhere.
struct Settled {
  double tolerance = 0.0;  ///< 0: not known
  std::array<double, kChannels> noise_scale{};
};

/// fit() for one of several models that share a first guess: of what is not this model's the guess
/// is silently ignored.
/// @param near  of the fit whose solution is the start.
[[nodiscard]] data::Fit fit_one_of_several(std::span<const data::Track> tracks,
                                           const data::Scene& scene, const FitOptions& options,
                                           Bars bars = Bars::full, const Settled& near = {});

/// What explains the longest first part of a single arc that a search came across, if more than a
/// fifth of it; else empty.
struct FirstPart {
  std::map<std::string, double> values;  ///< of the parameters, by name, in their SI units
  double from_s = 0.0, until_s = 0.0;    ///< when its first and last samples were taken
  [[nodiscard]] bool empty() const { return values.empty(); }
};

/// A fit with its error bars by curvature, as far as models are compared by it.
struct Draft {
  data::Fit fit;
  /// The same with full error bars, made when first asked for, while the tracks live. Not for
  /// several threads at once.
  std::function<data::Fit()> full;
  Settled settled;
};

/// fit_one_of_several() that leaves full error bars for later.
/// @param first_part  null, or receives what the search came across.
[[nodiscard]] Draft draft_one_of_several(std::span<const data::Track> tracks,
                                         const data::Scene& scene, const FitOptions& options,
                                         FirstPart* first_part = nullptr, const Settled& near = {});

/// Strategy of a sliding model whose given start is that of a body that rolls at first.
inline constexpr const char* kRollsFirst = "rolls_first";

}  // namespace trochoid::fitting
