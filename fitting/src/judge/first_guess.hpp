#pragma once
#include <map>
#include <set>
#include <string>

#include "trochoid/data/scene.hpp"
#include "trochoid/fitting/fit.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::fitting {

/// The scene as its model takes it: with a start for a friction that is to be found, and with what
/// priors say for what is given.
[[nodiscard]] data::Scene completed(const data::Scene& given, const FitOptions& options);

/// Names of a model's parameters, those among them that the way in which a scene was observed adds.
[[nodiscard]] std::set<std::string> names_in(const model::Predictor& plain, data::Scene scene);

/// Parameters a first guess for a fit of this scene may name.
[[nodiscard]] std::set<std::string> parameters_of(const data::Scene& scene);

/// @param whose  the model or models meant, as in "model 'top' has".
/// @throws InputError naming a parameter of the guess that is not `known`, and those that are.
void check_first_guess(const std::map<std::string, double>& guess, const std::string& whose,
                       const std::set<std::string>& known);

}  // namespace trochoid::fitting
