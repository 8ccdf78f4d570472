#pragma once
#include <memory>
#include <vector>

#include "start/strategy.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::fitting {

/// Where a search without a guess starts, by the model.
[[nodiscard]] Starter starter_for(const model::Predictor& predictor, const data::Scene& scene);

/// What positions alone do not tell from a solution, by the model.
[[nodiscard]] Lookalikes lookalikes_for(const model::Predictor& predictor,
                                        const data::Scene& scene);

/// A relative with the models it is made of.
struct OwnedRelative {
  std::unique_ptr<model::Predictor> model;
  std::vector<std::unique_ptr<model::Predictor>> bridges;
};

/// Easier relatives of a sliding body, see Relative; none for other models.
[[nodiscard]] std::vector<OwnedRelative> relatives_of(data::Scene scene);

}  // namespace trochoid::fitting
