#pragma once
#include <Eigen/Core>
#include <string>
#include <vector>

#include "trochoid/data/error.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/model/outcome.hpp"

namespace trochoid::model {

/// Something that happened at an instant: slip, stick, flat, ...
struct Event {
  double t_s;
  std::string name;
};

struct Statistics {
  int steps = 0;
  int rejected = 0;
  int evaluations = 0;  ///< of the right-hand side
};

/// A finished run on a uniform time grid. Columns follow the reference files' names with units:
/// t_s, phi_rad, theta_rad, psi_rad, dphi_rad_s, dtheta_rad_s, dpsi_rad_s, x_m, y_m, z_m, energy_J
/// and what the model adds (w1_rad_s.., vx_m_s, vy_m_s, normal_force_N, ...).
struct Trajectory {
  std::string model;
  std::string integrator;         ///< chosen integrator
  std::string integrator_reason;  ///< why, in words
  std::vector<std::string> columns;
  Eigen::MatrixXd values;  ///< rows = times up to the end of the run
  std::vector<Event> events;
  Outcome outcome = Outcome::reached_end;
  double end_s = 0.0;
  /// Of the path, from a second run at a hundredth of the tolerance; NaN for the models whose
  /// centre of mass stays where it is (free, pivot).
  double error_estimate_m = 0.0;
  /// Of the direction of the axis, likewise; of the spin angle where the axis is upright (puck,
  /// pivot).
  double error_estimate_rad = 0.0;
  Statistics statistics;
};

/// The model has no use for the integrator that run.integrator asks for.
class NotOffered : public InputError {
 public:
  using InputError::InputError;
};

/// Runs the scene's model from [start] over [run]. Never silently wrong: see Outcome.
/// @throws InputError if the scene lacks what the model needs, NotOffered.
[[nodiscard]] Trajectory simulate(const data::Scene& scene);

}  // namespace trochoid::model
