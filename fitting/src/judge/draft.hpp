#pragma once
#include <array>
#include <functional>
#include <map>
#include <span>
#include <string>

#include "observe/observations.hpp"
#include "trochoid/fitting/fit.hpp"

// Fits of one of several models, between which a comparison chooses; defined beside fit().
namespace trochoid::fitting {

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

}  // namespace trochoid::fitting
