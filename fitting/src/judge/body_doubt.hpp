#pragma once
#include <Eigen/Core>
#include <string>
#include <vector>

#include "problem/problem.hpp"

namespace trochoid::fitting {

/// Gives body and gravity of a scene the values of the priors stated on them; where a radius gave
/// the metres, the scale that follows gets its own (scale_by_radius).
void take_priors_for_given(data::Scene& scene);

/// Something the model takes for given that is known to a prior's standard deviation only.
struct Doubt {
  std::string name;
  Eigen::VectorXd shift;  ///< of the fitted values, to first order, one standard deviation later
};

/// The doubts in the body's mass, moments and measures and in gravity for which [fit] prior states
/// a standard deviation and which are no parameters of the model. A radius that gave the scale is
/// not among them: the scale's own prior holds it.
/// @param frame_time_s as of observed().
[[nodiscard]] std::vector<Doubt> body_doubts(const Problem& problem, const Eigen::VectorXd& u,
                                             const data::Scene& scene, double frame_time_s);

/// The spins of a puck that nothing shows, one for each arc: friction acts with less of its
/// strength along the path of one that turns. A shift is that of a rim as fast as the puck slides,
/// as far as the path does not rule it out; none for other models and where the spin is fitted,
/// fixed or given.
[[nodiscard]] std::vector<Doubt> unseen_spins(const Problem& problem, const Eigen::VectorXd& u,
                                              const data::Scene& scene);

/// What a floor that rises by `rise` (per length, one standard deviation in any direction) would be
/// of a puck's friction, as far as the path does not rule it out: along a straight path a slope
/// acts as friction does. 0 for other models, where the slope is fitted or given and where the
/// friction is not fitted.
/// @param frame_time_s as of observed().
[[nodiscard]] double friction_of_rise(const Problem& problem, const Eigen::VectorXd& u,
                                      const data::Scene& scene, double rise, double frame_time_s);

/// Names under [fit] prior that mean nothing to this model or its body.
[[nodiscard]] std::vector<std::string> idle_priors(const Problem& problem,
                                                   const data::Scene& scene);

}  // namespace trochoid::fitting
