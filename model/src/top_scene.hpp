#pragma once
#include "trochoid/data/scene.hpp"

namespace trochoid::model {

/// What a scene says about a top, with the groups that enter its dynamics.
struct TopSettings {
  double a_1_s2 = 1.0;                              ///< m g l / I
  double b_1_s = 1.0;                               ///< Is omega_s / I
  double l_m = 0.1;                                 ///< pivot to CoM
  double gamma1_1_s = 0.0;                          ///< c1 / I
  double gamma3_1_s = 0.0;                          ///< c3 / Is
  double dry_1_s2 = 0.0;                            ///< t0 / I
  double quadratic = 0.0;                           ///< q3 I / Is^2
  bool drag = false;                                ///< any of the four
  bool transverse_drag = false, spin_drag = false;  ///< named in the scene
  bool dry_drag = false, quadratic_drag = false;    ///< likewise
  double omega_s_rad_s = 1.0;
  double theta_rad = 0.0, phi_rad = 0.0, psi_rad = 0.0;
  double dtheta_rad_s = 0.0, dphi_rad_s = 0.0;
  double pivot_x_m = 0.0, pivot_y_m = 0.0;
  /// For the energy; without mass and moments the energy is per unit I.
  double I_kg_m2 = 1.0, Is_kg_m2 = 1.0, weight_times_l_J = 0.0;
};

/// For a fit: what is missing gets a value to start from.
[[nodiscard]] TopSettings top_for_prediction(const data::Scene& scene);
/// For a run: everything that moves the top must be said.
/// @throws InputError naming the missing field.
[[nodiscard]] TopSettings top_for_simulation(const data::Scene& scene);

/// After which time dry drag has used up a spin: b' = -(dry + gamma3 b + quadratic b^2) for b > 0.
/// Infinite without dry drag, 0 without a spin.
/// @param b_1_s, dry_1_s2, gamma3_1_s, quadratic  the spin at the start, of either sign, and the
///        drags, none negative.
[[nodiscard]] double spin_lasts_s(double b_1_s, double dry_1_s2, double gamma3_1_s,
                                  double quadratic);

/// The thesis' own equations know no friction. @throws InputError if the scene asks for drag.
[[nodiscard]] TopSettings without_drag(const TopSettings& top);

}  // namespace trochoid::model
