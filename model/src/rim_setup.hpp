#pragma once
#include <string>
#include <vector>

#include "trochoid/data/scene.hpp"
#include "trochoid/model/dissipation.hpp"
#include "trochoid/model/predictor.hpp"
#include "trochoid/model/rim_body.hpp"

/// From a scene to the bodies, terms and start of the models with rim contact.
namespace trochoid::model {

/// @throws InputError if the body is no disc or ring or there is no gravity; of a scene also if a
/// term needs a mass that is not given.
[[nodiscard]] RimBody rim_body(const data::Body& body, double gravity_m_s2);
[[nodiscard]] RimBody rim_body(const data::Scene& scene);

/// Start of a rim model; rates as node components. Velocity of the centre, where it is a state.
struct RimStart {
  double theta_rad = 0.0, phi_rad = 0.0, psi_rad = 0.0;
  double w1_rad_s = 0.0, w2_rad_s = 0.0, w3_rad_s = 0.0;
  double x_m = 0.0, y_m = 0.0, vx_m_s = 0.0, vy_m_s = 0.0;
};
/// The scene's start; a velocity that is not given is that of rolling, and of one of which a
/// component is given the other is 0.
/// @throws InputError if theta is missing or not inside (0, pi).
[[nodiscard]] RimStart rim_start(const data::Scene& scene, const RimBody& body);
/// The same for a fit, where the start is only a hint: what is missing is that of a disc wobbling
/// about its resting centre (w3 = 0, steady precession).
[[nodiscard]] RimStart rim_start_or_typical(const data::Scene& scene, const RimBody& body);

/// Coefficients of every loss term, in the order of `kLossNames`, and the floor's slope; scalars so
/// that derivatives pass.
inline constexpr int kLosses = 9;
extern const char* const kLossNames[kLosses];
enum class Loss : int {
  air1,
  air3,
  quadratic1,
  quadratic3,
  force,
  gap,
  rolling,
  pivoting,
  contour
};

template <class S>
struct LossValues {
  S value[kLosses];
  double air_ratio = 1.0;        ///< c2/c1
  double quadratic_ratio = 1.0;  ///< q2/q1
  double eps_w = 0.01;
  World<S> rise{S(0.0), S(0.0)};  ///< of the floor per length
  [[nodiscard]] const S& operator[](Loss loss) const { return value[static_cast<int>(loss)]; }
};

/// The scene's coefficients, 0 where a term is absent.
/// @throws InputError if one is negative.
[[nodiscard]] LossValues<double> loss_values(const data::ModelSettings& model);

/// One parameter for each coefficient that is present and not zero.
[[nodiscard]] std::vector<ParameterInfo> loss_parameters(const data::ModelSettings& model);

template <class S>
void assign(LinearAir<S>& term, const LossValues<S>& v) {
  term = {v[Loss::air1], v[Loss::air1] * v.air_ratio, v[Loss::air3]};
}
template <class S>
void assign(QuadraticAir<S>& term, const LossValues<S>& v) {
  term = {v[Loss::quadratic1], v[Loss::quadratic1] * v.quadratic_ratio, v[Loss::quadratic3]};
}
template <class S>
void assign(AirForce<S>& term, const LossValues<S>& v) {
  term.c_v = v[Loss::force];
}
template <class S>
void assign(GapLayer<S>& term, const LossValues<S>& v) {
  term.eta = v[Loss::gap];
}
template <class S>
void assign(RollingFriction<S>& term, const LossValues<S>& v) {
  term = {v[Loss::rolling], v.eps_w};
}
template <class S>
void assign(PivotingFriction<S>& term, const LossValues<S>& v) {
  term = {v[Loss::pivoting], v.eps_w};
}
template <class S>
void assign(ContourFriction<S>& term, const LossValues<S>& v) {
  term = {v[Loss::contour], v.eps_w};
}
template <class S>
void assign(FloorSlope<S>& term, const LossValues<S>& v) {
  term.rise = v.rise;
}
template <class List, class S>
[[nodiscard]] List make_losses(const LossValues<S>& values) {
  List losses;
  losses.each([&](auto& term) { assign(term, values); });
  return losses;
}

/// A list of terms as a value, to choose a compiled model with.
template <template <class> class... Terms>
struct TermList {
  template <class S>
  using List = Losses<S, Terms...>;
};

using EveryLoss = TermList<LinearAir, QuadraticAir, AirForce, GapLayer, RollingFriction,
                           PivotingFriction, ContourFriction>;
using EveryLossOnSlope = TermList<LinearAir, QuadraticAir, AirForce, GapLayer, RollingFriction,
                                  PivotingFriction, ContourFriction, FloorSlope>;

/// Calls visit(TermList<...>) with the leanest compiled list that has every term of the scene.
template <class Visit>
auto with_terms(const data::ModelSettings& model, bool sloped, Visit&& visit) {
  if (sloped) return visit(EveryLossOnSlope{});
  const bool linear = model.air_linear_N_m_s.has_value();
  const bool other_air =
      model.air_quadratic_N_m_s2 || model.air_force_N_s_m || model.gap_viscosity_Pa_s;
  const bool couples =
      model.rolling_friction_m || model.pivoting_friction_m || model.contour_friction_m;
  if (couples && (linear || other_air)) return visit(EveryLoss{});
  if (couples) return visit(TermList<RollingFriction, PivotingFriction, ContourFriction>{});
  if (other_air) return visit(TermList<LinearAir, QuadraticAir, AirForce, GapLayer>{});
  if (linear) return visit(TermList<LinearAir>{});
  return visit(TermList<>{});
}

/// Sliding bodies have three compiled lists: no loss but friction, every loss, and on a slope.
template <class Visit>
auto with_few_terms(const data::ModelSettings& model, bool sloped, Visit&& visit) {
  if (sloped) return visit(EveryLossOnSlope{});
  const LossValues<double> losses = loss_values(model);
  bool any = false;
  for (const double value : losses.value) any = any || value > 0.0;
  if (!any) return visit(TermList<>{});
  return visit(EveryLoss{});
}

}  // namespace trochoid::model
