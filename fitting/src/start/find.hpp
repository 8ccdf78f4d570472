#pragma once
#include "start/strategy.hpp"
#include "trochoid/fitting/fit.hpp"

namespace trochoid::fitting {

/// An easier model, searched without a guess, and the steps from its solution to the model's own:
/// each is minimised from where the one before it ended.
struct Relative {
  const model::Predictor* model = nullptr;
  std::vector<const model::Predictor*> bridges;
};

/// How to look for a solution.
struct SearchRequest {
  Starter starter;
  const FitOptions* options = nullptr;
  bool start_given = false;
  /// Easier relatives of the model, tried first: a sliding body may nearly roll, and the equations
  /// of a softer friction law are less stiff. Their parameters are found by name.
  std::vector<Relative> relatives = {};
  /// Of what a search finds by positions alone.
  Lookalikes lookalikes = {};
};

/// Every arc alone (in parallel), without a guess or from the given start; then all arcs together
/// from each arc's idea of the shared parameters, or from that of the first few where these lead to
/// one minimum that passes the gate. Writes the arcs' values into problem.base.
/// @throws InputError if the strategy is not for the model.
[[nodiscard]] Found find(Problem& problem, const SearchRequest& asked);

}  // namespace trochoid::fitting
