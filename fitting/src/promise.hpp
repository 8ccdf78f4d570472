#pragma once
#include <map>
#include <set>
#include <span>
#include <string>

#include "trochoid/data/scene.hpp"
#include "trochoid/data/track.hpp"
#include "trochoid/fitting/fit.hpp"

namespace trochoid::fitting {

/// What a minimum's tangent plane says of a model with further losses, in chi-square by the noise
/// there: the score test (Rao, Proc. Camb. Phil. Soc. 44, 50, 1948). Costs two runs with
/// derivatives where a fit takes dozens.
struct Promise {
  double before = 0.0;            ///< without the further losses
  double with = 0.0;              ///< with them
  std::map<int, double> instead;  ///< with them and without one of the others, by its key
  /// How many times less a change of chi-square tells while residuals hang together.
  double dilution = 1.0;
  int rows = 0, further = 0;  ///< measurements; parameters of the further losses
};

/// @param options  its start holds the values at the minimum and next to nothing of the further
/// losses.
/// @param further  names of their parameters. What would have to be negative stays nothing.
/// @param others   names of the parameters of each loss that may be left out, by a key of its own.
/// @returns nothing (rows 0) where nothing can be told: several arcs, or no prediction.
[[nodiscard]] Promise promised(std::span<const data::Track> tracks, const data::Scene& scene,
                               const FitOptions& options, const std::set<std::string>& further,
                               const std::map<int, std::set<std::string>>& others);

}  // namespace trochoid::fitting
