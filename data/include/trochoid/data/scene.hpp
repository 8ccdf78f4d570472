#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "trochoid/data/body.hpp"
#include "trochoid/data/camera.hpp"

namespace trochoid::data {

/// What holds the body. floor: its rim rolls or slides; flat: it lies on its face; pivot: a fixed
/// point of its axis; none: free.
enum class SupportKind { floor, flat, pivot, none };
struct Support {
  static constexpr double kSteepest = 0.2;
  SupportKind kind = SupportKind::floor;
  std::optional<Eigen::Vector3d> pivot_m;
  /// The floor's rise per length along x and y, at most kSteepest; absent: level.
  std::optional<double> slope_x = {}, slope_y = {};
};

/// How pixels become metres. At most one of file / scale; with neither, the known radius gives the
/// scale.
struct CameraSettings {
  std::string file;  ///< camera.json, relative to the scene file
  std::optional<double> scale_px_per_m;
  std::optional<double> height_m;  ///< of the camera above the floor, with scale_px_per_m
  double readout_s = 0.0;          ///< rolling shutter: first to last row
  std::optional<double> rows;      ///< image height [px], for fitting the readout without a file
  std::optional<double> frame_rate_hz;  ///< overrides the container's time stamps
  /// Just before each of these a picture was dropped which the times do not show: all from there on
  /// are a frame later than the recording says. Twice the same: two pictures.
  std::vector<std::int64_t> missing_frames;
  std::optional<double> exposure_s;
  std::optional<Transfer> transfer;  ///< instead of what the camera's file says
};

/// Hints to the tracker; all optional.
struct TrackingSettings {
  static constexpr int kMostObjects = 64;
  int objects = 1;                       ///< moving bodies, 1 to kMostObjects
  std::optional<Eigen::Vector2d> at_px;  ///< a point on the body in the first frame
  std::string from, to;                  ///< seconds ("1.5") or frames ("f120"); empty = all
};

/// Model name and terms. A term that is present is switched on; units are in the names.
/// Symbols of the theory pages in brackets.
struct ModelSettings {
  /// free | top | top-euler | smooth | rolling | sliding | puck | pivot | auto
  std::string name = "auto";
  double gravity_m_s2 = 9.81;
  std::optional<Eigen::Vector3d> air_linear_N_m_s;      ///< c_i: couple -c_i w_i (node axes)
  std::optional<Eigen::Vector3d> air_quadratic_N_m_s2;  ///< q_i: couple -q_i |w| w_i
  std::optional<double> air_force_N_s_m;                ///< c_v: force -c_v v
  std::optional<double> gap_viscosity_Pa_s;             ///< eta: gap layer of [Moffatt2000]
  std::optional<double> friction;                       ///< mu
  std::optional<double> slip_regularisation_m_s;        ///< eps_v; absent or 0 = exact Coulomb law
  std::optional<double> contact_radius_m;               ///< of a puck; absent: all of its face
  std::optional<double> rolling_friction_m;             ///< mu_r
  std::optional<double> pivoting_friction_m;            ///< mu_p
  std::optional<double> contour_friction_m;             ///< mu_c
  std::optional<double> couple_regularisation_rad_s;    ///< eps_omega
  std::optional<double> drag_transverse_N_m_s;          ///< c1 of the top
  std::optional<double> drag_spin_N_m_s;                ///< c3 of the top
  std::optional<double> drag_spin_dry_N_m;              ///< t0 of the top
  std::optional<double> drag_spin_quadratic_N_m_s2;     ///< q3 of the top
  std::optional<double> spin_down_dry_rad_s2;           ///< t0/C of the fixed-pivot disc
  std::optional<double> spin_down_weakening_s_rad;      ///< k: dry/(1 + k |w|)
  std::optional<double> spin_down_viscous_1_s;          ///< t1/C
  std::optional<double> spin_down_quadratic_1_rad;      ///< t2/C
  /// Weight out of balance: -sin(psi) and -cos(psi) parts of its couple, over C.
  std::optional<double> spin_down_imbalance_sin_rad_s2, spin_down_imbalance_cos_rad_s2;
};

/// Initial state: for simulate the truth, for fit only a hint. Of each pair (w2, dphi), (w1,
/// dtheta), (w3, dpsi) at most one is given.
struct StartSettings {
  std::optional<double> theta_rad, phi_rad, psi_rad;
  std::optional<double> w1_rad_s, w2_rad_s, w3_rad_s;
  std::optional<double> dtheta_rad_s, dphi_rad_s, dpsi_rad_s;
  std::optional<double> omega_s_rad_s;  ///< spin about the own axis of a top
  std::optional<double> x_m, y_m, vx_m_s, vy_m_s;
  std::optional<Eigen::Vector3d> w_body_rad_s;   ///< free body: angular velocity in body axes
  std::optional<Eigen::Vector3d> moments_kg_m2;  ///< free body: principal moments
};

struct RunSettings {
  double until_s = 10.0;
  double rate_hz = 100.0;
  double tolerance = 1e-10;
  /// auto | dop853 | taylor | radau | cvode-adams | cvode-bdf | arkode
  std::string integrator = "auto";
  std::string rim_switch = "end";  ///< what theta = pi/2 does to a thick body: end | impact
};

/// value and standard deviation from outside the recording (a scale, a caliper).
struct Prior {
  double value = 0.0;
  double sigma = 0.0;
};

struct FitSettings {
  std::vector<std::string> free;  ///< parameter names or groups; empty = the model's choice
  std::map<std::string, Prior> prior;
  std::map<std::string, double> fixed;
  std::map<std::string, std::pair<double, double>> bounds;
  bool free_pivot = false;
  bool free_scale = false;
};

/// Everything the program may know about a recording before it looks at it. Every table but [body]
/// may be absent; see docs/formats.md.
struct Scene {
  std::optional<Body> body;
  Support support;
  CameraSettings camera;
  TrackingSettings tracking;
  ModelSettings model;
  StartSettings start;
  RunSettings run;
  FitSettings fit;
};

}  // namespace trochoid::data
