#pragma once
#include <string>
#include <vector>

#include "trochoid/data/scene.hpp"

namespace trochoid::model {

/// The keys of [model], [start] and [run] that the scene gives and its model never looks at, as
/// "model.friction": not wrong, since a scene may serve several models, but without effect.
/// Tested property, of every key that can be changed alone: it changes the run of a model, or it is
/// idle there.
[[nodiscard]] std::vector<std::string> idle_keys(const data::Scene& scene);

}  // namespace trochoid::model
