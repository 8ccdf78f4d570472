#include "judge/first_guess.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>

#include "judge/body_doubt.hpp"
#include "observe/observed.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::fitting {
namespace {

// A coefficient that is to be found needs no first value.
void give_friction_a_start(data::Scene& scene) {
  constexpr double kTypical = 0.2;
  const std::string& name = scene.model.name;
  const bool needed = name == "sliding" || name == "puck" ||
                      (name == "auto" && scene.support.kind == data::SupportKind::flat);
  if (needed && !scene.model.friction) scene.model.friction = kTypical;
}

// "x_m@1" is the x_m of arc 1.
std::string without_arc(const std::string& name) {
  const std::size_t at = name.find('@');
  const bool arc = at != std::string::npos && at + 1 < name.size() &&
                   name.find_first_not_of("0123456789", at + 1) == std::string::npos;
  return arc ? name.substr(0, at) : name;
}

}  // namespace

std::set<std::string> names_in(const model::Predictor& plain, data::Scene scene) {
  const auto wrapped = observed(plain, scene, 0.0);
  std::set<std::string> names;
  for (const model::ParameterInfo& info : (wrapped ? *wrapped : plain).parameters())
    names.insert(info.name);
  return names;
}

data::Scene completed(const data::Scene& given, const FitOptions& options) {
  data::Scene scene = given;
  if (!options.model.empty()) scene.model.name = options.model;
  give_friction_a_start(scene);
  take_priors_for_given(scene);
  return scene;
}

std::set<std::string> parameters_of(const data::Scene& given) {
  const data::Scene scene = completed(given, {});
  return names_in(*model::make_predictor(scene), scene);
}

void check_first_guess(const std::map<std::string, double>& guess, const std::string& whose,
                       const std::set<std::string>& known) {
  for (const auto& [name, value] : guess) {
    if (!known.contains(without_arc(name)))
      throw InputError(fmt::format("start: no parameter is called '{}'; {} {}", name, whose,
                                   fmt::join(known, ", ")));
    if (!std::isfinite(value))
      throw InputError(fmt::format("start: {} = {} must be a finite number", name, value));
  }
}

}  // namespace trochoid::fitting
