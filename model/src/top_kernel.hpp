#pragma once

/// What the top's inner loops take and give: plain numbers, so that copies built for different
/// instruction sets share nothing but these.
namespace trochoid::model {

/// Parameters that need the variational equations; the others enter the observation in closed form.
enum TopVariable {
  kTopA,
  kTopB,
  kTopGamma1,
  kTopGamma3,
  kTopTheta,
  kTopDtheta,
  kTopDphi,
  kTopDry,
  kTopQuadratic,
  kTopVariables
};

/// Derivatives carried along: all but that by the quadratic drag fit into 8 lanes.
inline constexpr int kTopLanes = 8, kTopMostLanes = 16;

struct TopRun {
  double variable[kTopVariables];
  double phi_rad = 0.0;
  bool drag = false;                      ///< linear, or any
  bool dry = false, quadratic = false;    ///< drag on the spin of these kinds as well
  double spin_stops_s = __builtin_inf();  ///< when dry drag has stopped the spin
  bool with_derivatives = false;
  bool with_angles = false;  ///< follow phi and psi, not only the axis
  double start_s = 0.0;
  double end_s = 0.0;
  const double* t_s = nullptr;
  int count = 0;
  double tolerance = 1e-9;
  int max_steps = 1000000;
};

/// Columns: 0..2 axis k, 3 phi (unwrapped), 4 psi without psi_0 and omega_s (zero at the start), 5
/// integral of b (with dry or quadratic drag only), 6..8 angular momentum over I, 9 spin momentum
/// b.
inline constexpr int kTopColumns = 10;
inline constexpr int kTopAxisColumns = 3, kTopTurns = 5, kTopAngleColumns = 6;
/// End state: theta, phi, dtheta, dphi, b, psi as in column 4, integral of b as in column 5.
inline constexpr int kTopEndValues = 7;

/// The observation most fits want, written whole by the kernel: x and y interleaved (x0, y0, x1,
/// ...), and columns of their derivatives laid out likewise.
struct TopPath {
  double l_m = 0.0, pivot_x_m = 0.0, pivot_y_m = 0.0;
  double* xy = nullptr;  ///< 2 x count; null: the columns of TopResult are wanted
  double* by_variable[kTopMostLanes] = {};  ///< indexed by TopVariable; null: not wanted
  double* by_l = nullptr;
  double* by_phi = nullptr;
};

struct TopResult {
  double* value[kTopColumns] = {};                      ///< count numbers each; may be null
  double* derivative[kTopColumns][kTopMostLanes] = {};  ///< likewise, by TopVariable
  TopPath path;
  double end[kTopEndValues] = {};
  double end_derivative[kTopEndValues][kTopMostLanes] = {};
  int written = 0;     ///< times that have been reached
  int end_reason = 0;  ///< RunEnd
  double reached_s = 0.0;
  int steps = 0, rejected = 0, evaluations = 0;
};

}  // namespace trochoid::model
