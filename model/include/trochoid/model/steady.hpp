#pragma once
#include <optional>
#include <string_view>
#include <vector>

#include "trochoid/data/body.hpp"
#include "trochoid/model/rim_body.hpp"

/// Steady motions of a disc or ring of finite thickness on a horizontal floor: tilt, precession and
/// spin rates constant. Equation numbers of model/theory/steady.md.
namespace trochoid::model {

enum class Floor {
  rough,   ///< rolls without slip
  smooth,  ///< no friction: the centre of mass stays above one point (or drifts uniformly)
};

enum class SteadyKind {
  flat,              ///< at rest on its face
  straight_rolling,  ///< upright, along a line
  upright_spinning,  ///< upright, about its vertical diameter
  circular_rolling,  ///< tilted, the centre of mass on a circle
  tilted_spinning,   ///< tilted, the centre of mass at rest
};
[[nodiscard]] std::string_view name(SteadyKind kind);
[[nodiscard]] std::string_view name(Floor floor);

struct SteadyMotion {
  Floor floor = Floor::rough;
  SteadyKind kind = SteadyKind::circular_rolling;
  double theta_rad = 0.0;
  double precession_rad_s = 0.0;  ///< W = dphi/dt
  double w3_rad_s = 0.0;          ///< angular velocity about the symmetry axis
  double circle_radius_m = 0.0;   ///< of the path of the centre of mass; infinite on a line
  double normal_force_N = 0.0;
  double friction_demand = 0.0;  ///< least Coulomb coefficient that bears it
  /// Square of the frequency of a small nutation [1/s^2]; negative: grows at the rate of its root.
  /// NaN where the body rests on a line or a face, which no small tilt leaves.
  double nutation2_1_s2 = 0.0;
  [[nodiscard]] bool stable() const { return !(nutation2_1_s2 < 0.0); }
};

/// Spin of steady rolling at a tilt and precession rate, (2); any tilt at which the rim touches.
[[nodiscard]] double steady_rolling_spin(const RimBody& body, double theta_rad,
                                         double precession_rad_s);
/// Precession rates of steady rolling at a tilt whose centre of mass moves at `along_m_s` along the
/// node line: the roots of (1), up to two, its spin being that of rolling; empty where there are
/// none.
[[nodiscard]] std::vector<double> steady_rolling_precessions(const RimBody& body, double theta_rad,
                                                             double along_m_s);

/// The steady rolling motion of given tilt and precession rate, (2): its spin is unique.
/// @param theta_rad in (0, pi/2).  @param precession_rad_s not 0.
/// @throws InputError for a body without a rim or arguments out of range.
[[nodiscard]] SteadyMotion steady_rolling(const data::Body& body, double gravity_m_s2,
                                          double theta_rad, double precession_rad_s);
/// The steady rolling motion of given tilt whose centre of mass runs on a circle of given radius,
/// (4); radius 0 is the spinning (Euler) disc. A negative radius asks for the circle on which the
/// disc leans outwards. Nothing if there is none.
[[nodiscard]] std::optional<SteadyMotion> steady_rolling_on_circle(const data::Body& body,
                                                                   double gravity_m_s2,
                                                                   double theta_rad,
                                                                   double circle_radius_m);
/// The up to two steady motions of given tilt and spin on a smooth floor, (5), slow one first.
[[nodiscard]] std::vector<SteadyMotion> steady_smooth(const data::Body& body, double gravity_m_s2,
                                                      double theta_rad, double w3_rad_s);
/// Least spin rate |w3| at which a thin body rolls upright in a straight line, and least precession
/// rate at which it spins upright about its diameter, (7) and (8); on a rough floor. A body with
/// thickness stands on its wall and needs neither.
[[nodiscard]] double least_rolling_rate_rad_s(const data::Body& body, double gravity_m_s2);
[[nodiscard]] double least_spinning_rate_rad_s(const data::Body& body, double gravity_m_s2);

/// The families on both floors at the given tilts: flat, straight rolling and upright spinning (at
/// twice the least rate), spinning at a tilt, and rolling on circles of 1, 2 and 5 rim radii
/// and, leaning outwards, of 1.
[[nodiscard]] std::vector<SteadyMotion> steady_catalogue(const data::Body& body,
                                                         double gravity_m_s2,
                                                         const std::vector<double>& tilts_rad);

}  // namespace trochoid::model
