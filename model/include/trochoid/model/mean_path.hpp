#pragma once
#include <Eigen/Core>
#include <optional>

namespace trochoid::model {

/// Path of the CoM with its fast circling averaged out, against the precession angle: the moving
/// average of (x, y) over one turn of phi, taken twice. Its heading turns at (W - nu)/W per unit of
/// phi, W the precession rate and nu the nutation frequency: prograde while nu < W, retrograde
/// after the inflection nu = W (model/theory/steady.md, (9)).
struct MeanPath {
  Eigen::VectorXd t_s, phi_rad, x_m, y_m;
  Eigen::VectorXd heading_per_phi;  ///< d(heading)/d(phi), dimensionless

  /// First time the heading rate falls through zero, averaged over one turn so that the remaining
  /// nutation does not decide; nothing if it stays on one side.
  [[nodiscard]] std::optional<double> inflection_s() const;
  /// Mean heading rate in `parts` equal spans of phi, 1 <= parts <= number of points.
  [[nodiscard]] Eigen::VectorXd heading_in_parts(int parts) const;
};

/// @param t_s, phi_rad, x_m, y_m  a trajectory, >= 4 rows; phi strictly monotonic over more than
///        three turns; at least 8 rows per turn.
/// @throws InputError if phi is not monotonic or too short.
[[nodiscard]] MeanPath mean_path(const Eigen::VectorXd& t_s, const Eigen::VectorXd& phi_rad,
                                 const Eigen::VectorXd& x_m, const Eigen::VectorXd& y_m);

}  // namespace trochoid::model
