#pragma once
#include <map>
#include <optional>
#include <string>

#include "problem/transform.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::fitting {

/// How friction sets in: the slip speed of the regularised law, absent in Coulomb's.
inline constexpr const char* kSlipScale = "slip_regularisation_m_s";
/// How much the floor rises per length.
inline constexpr const char* kSlopeX = "slope_x";
inline constexpr const char* kSlopeY = "slope_y";
/// A law sharper than that makes stiff equations, and no camera tells it from Coulomb's.
inline constexpr double kSharpest_m_s = 5e-5;

inline constexpr double kAirViscosity_Pa_s = 1.8e-5;
/// The gap layer's law for small tilts may miss air's viscosity by a few times, not by more.
inline constexpr double kThickestAir_Pa_s = 10.0 * kAirViscosity_Pa_s;
/// Whether a scene speaks of a gap layer of its own: as viscous as water, or by what [fit] says.
[[nodiscard]] bool tells_of_a_film(const data::Scene& scene);

struct FreeParameter {
  int index = 0;  ///< into Predictor::parameters()
  int arc = -1;   ///< -1: shared by all arcs
  Transform transform;
  std::optional<data::Prior> prior;
  std::optional<data::Prior> soft_prior;  ///< on u, while exploring: short windows see no friction
  double given = 0.0;  ///< value before any fitting: the scene's, or the model's default
  bool held = false;   ///< stays where it is for now
  bool turns = false;  ///< an angle that whole turns bring back
};

/// How far a value is from what is known of it beforehand [standard deviations].
/// @param turns  whole turns are no distance.
[[nodiscard]] double off_prior(const data::Prior& prior, double value, bool turns);

/// Whether it came to lie where it is no longer sought, as a friction that is never overcome.
[[nodiscard]] inline bool at_its_limit(const FreeParameter& parameter, double value) {
  return parameter.transform.kind == Transform::Kind::limited &&
         value > 0.98 * parameter.transform.upper;
}

/// Whether a name under [fit] means a parameter: its own, or that of a term, which stands for all
/// its components ("air_linear_N_m_s" for "air_linear_N_m_s[1]").
[[nodiscard]] bool means(const std::string& entry, const std::string& parameter);

/// What a table under [fit] says of a parameter: by its own name, else by its term's; null:
/// nothing.
template <class Value>
const Value* said_of(const std::string& parameter, const std::map<std::string, Value>& entries) {
  auto entry = entries.find(parameter);
  if (entry == entries.end()) entry = entries.find(parameter.substr(0, parameter.find('[')));
  return entry == entries.end() ? nullptr : &entry->second;
}

/// What is known beforehand of a parameter in an arc: of that arc alone ("theta_rad@1"), else of
/// all.
/// @param arc  -1: shared by all.
[[nodiscard]] const data::Prior* prior_of(const std::string& parameter, int arc,
                                          const data::FitSettings& settings);

/// Whether a parameter is how much the floor rises.
[[nodiscard]] bool is_slope(const std::string& name);

/// Whether naming a parameter in [fit] free leaves the model its own choice of the others: where
/// its pivot is, when it was seen, how friction sets in, whether the floor is level.
[[nodiscard]] bool leaves_choice(const std::string& name);

/// @throws InputError for a free, fixed or bounded name the model does not have, a fixed value it
/// cannot have, and a prior about one that it, or its bounds, rule out.
void check_settings(const model::Predictor& predictor, const data::FitSettings& settings);

/// Whether a parameter is to be fitted: asked for, known to some error only, or the model's own
/// choice where the settings leave it that.
[[nodiscard]] bool is_free(const model::ParameterInfo& info, const data::FitSettings& settings);

/// A parameter to be fitted, as [fit] bounds it and knows it beforehand.
/// @param index  into predictor.parameters() @param arc  whose it is, -1: all of them share it
/// @param value  before any fitting, in the parameter's unit
[[nodiscard]] FreeParameter free_parameter(const model::Predictor& predictor,
                                           const data::FitSettings& settings, int index, int arc,
                                           double value);

}  // namespace trochoid::fitting
