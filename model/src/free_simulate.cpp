#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "factories.hpp"
#include "solve.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/model/free_body.hpp"
#include "trochoid/model/inertia.hpp"

// A torque-free body, tumbling about its centre of mass: rungs M0 and M1.
namespace trochoid::model {
namespace {

struct FreeSettings {
  Eigen::Vector3d moments_kg_m2;
  Eigen::Vector3d w_rad_s;  ///< in body axes
  double phi_rad, theta_rad, psi_rad;
};

Eigen::Vector3d moments_of(const data::Scene& scene) {
  Eigen::Vector3d moments;
  if (scene.start.moments_kg_m2) {
    moments = *scene.start.moments_kg_m2;
  } else if (scene.body && scene.body->kind != data::BodyKind::top) {
    const CentralInertia inertia = central_inertia(*scene.body);
    moments << inertia.transverse_kg_m2, inertia.transverse_kg_m2, inertia.axial_kg_m2;
  } else {
    throw InputError(
        "start.moments_kg_m2 is missing: model \"free\" needs it or the shape of a disc or ring");
  }
  const double sum = moments.sum();
  for (int i = 0; i < 3; ++i) {
    constexpr double kSlack = 1e-9;
    if (!(moments[i] > 0.0) || !(2.0 * moments[i] <= sum * (1.0 + kSlack))) {
      throw InputError(
          fmt::format("start.moments_kg_m2 = [{:g}, {:g}, {:g}] belong to no body: each must be "
                      "positive and at "
                      "most the sum of the other two",
                      moments[0], moments[1], moments[2]));
    }
  }
  return moments;
}

/// Angular velocity about the axis: given, or the Euler rates' dpsi + dphi cos(theta).
double spin_of(const data::StartSettings& start, double theta) {
  if (start.w3_rad_s) return *start.w3_rad_s;
  if (start.omega_s_rad_s) return *start.omega_s_rad_s;
  const double dpsi = start.dpsi_rad_s.value_or(0.0);
  if (!start.w2_rad_s) return dpsi + start.dphi_rad_s.value_or(0.0) * std::cos(theta);
  if (std::sin(theta) == 0.0)
    throw InputError("start.w2_rad_s tells no dphi_rad_s at theta_rad = 0; give w3_rad_s");
  return dpsi + *start.w2_rad_s / std::tan(theta);
}

/// Body rates from whatever the scene gives: body axes, node axes, or Euler rates (3).
Eigen::Vector3d rates_of(const data::StartSettings& start, double theta, double psi) {
  if (start.w_body_rad_s) return *start.w_body_rad_s;
  const double w1 = start.w1_rad_s.value_or(start.dtheta_rad_s.value_or(0.0));
  const double w2 = start.w2_rad_s.value_or(start.dphi_rad_s.value_or(0.0) * std::sin(theta));
  const double spin = spin_of(start, theta);
  return {w1 * std::cos(psi) + w2 * std::sin(psi), -w1 * std::sin(psi) + w2 * std::cos(psi), spin};
}

FreeSettings settings_of(const data::Scene& scene) {
  FreeSettings free;
  free.moments_kg_m2 = moments_of(scene);
  free.theta_rad = scene.start.theta_rad.value_or(data::kPi / 4.0);
  free.phi_rad = scene.start.phi_rad.value_or(0.0);
  free.psi_rad = scene.start.psi_rad.value_or(0.0);
  free.w_rad_s = rates_of(scene.start, free.theta_rad, free.psi_rad);
  if (!free.w_rad_s.allFinite() || !std::isfinite(free.theta_rad + free.phi_rad + free.psi_rad))
    throw InputError("the free body's start holds a number that is not finite");
  return free;
}

State<double, 7> start_state(const FreeSettings& free) {
  const double c = std::cos(0.5 * free.theta_rad), s = std::sin(0.5 * free.theta_rad);
  const double sum = 0.5 * (free.phi_rad + free.psi_rad);
  const double difference = 0.5 * (free.phi_rad - free.psi_rad);
  return {{free.w_rad_s[0], free.w_rad_s[1], free.w_rad_s[2], c * std::cos(sum),
           s * std::cos(difference), s * std::sin(difference), c * std::sin(sum)}};
}

/// Near an unstable axis the small components decide what happens: errors count relative to the
/// smallest one that is not zero.
StepControl<7> control_of(const FreeSettings& free, double tolerance) {
  StepControl<7> control = uniform_control<7>(tolerance);
  const double largest = free.w_rad_s.cwiseAbs().maxCoeff();
  double smallest = largest;
  for (const double w : free.w_rad_s) {
    if (w != 0.0) smallest = std::min(smallest, std::abs(w));
  }
  for (int i = 0; i < 3; ++i)
    control.atol[i] = tolerance * (largest > 0.0 ? std::max(smallest, 1e-15 * largest) : 1.0);
  return control;
}

Solution run(const FreeSettings& free, const std::vector<double>& t_s, double tolerance,
             Method method) {
  const Eigen::Vector3d& I = free.moments_kg_m2;
  const auto duals = FreeBody<Dual<8>>::with_moments(I[0], I[1], I[2]);
  return solve(duals.values(), duals, start_state(free), t_s, control_of(free, tolerance), method);
}

/// phi and psi as continuous angles: half their sum and half their difference are the arguments of
/// (qw, qz) and (qx, qy), (4).
class Angles {
 public:
  Angles(double phi, double psi)
      : half_sum_(0.5 * (phi + psi)), half_difference_(0.5 * (phi - psi)) {}
  void follow(double qw, double qx, double qy, double qz) {
    if (qw != 0.0 || qz != 0.0) half_sum_ += data::wrapped(std::atan2(qz, qw) - half_sum_);
    if (qx != 0.0 || qy != 0.0)
      half_difference_ += data::wrapped(std::atan2(qy, qx) - half_difference_);
  }
  [[nodiscard]] double phi() const { return half_sum_ + half_difference_; }
  [[nodiscard]] double psi() const { return half_sum_ - half_difference_; }

 private:
  double half_sum_, half_difference_;
};

std::vector<std::string> columns() {
  std::vector<std::string> list = euler_columns();
  for (const char* name :
       {"wx_rad_s", "wy_rad_s", "wz_rad_s", "qw", "qx", "qy", "qz", "Lx_kg_m2_s", "Ly_kg_m2_s",
        "Lz_kg_m2_s", "integral_wx_rad", "integral_wy_rad", "integral_wz_rad"})
    list.emplace_back(name);
  return list;
}

/// Body rates, momentum in body axes, and what the thesis plots beside them.
void fill_row(const FreeSettings& free, double t_s, const Eigen::Ref<const Eigen::RowVectorXd>& y,
              Angles& angles, const Eigen::Vector3d& integral, Eigen::Ref<Eigen::RowVectorXd> row) {
  Eigen::Vector4d q(y[3], y[4], y[5], y[6]);
  q.normalize();
  angles.follow(q[0], q[1], q[2], q[3]);
  const double theta = 2.0 * std::atan2(std::hypot(q[1], q[2]), std::hypot(q[0], q[3]));
  const double psi = angles.psi(), s = std::sin(theta);
  const Eigen::Vector3d w(y[0], y[1], y[2]);
  const double across = w[0] * std::sin(psi) + w[1] * std::cos(psi);
  const double dphi = s != 0.0 ? across / s : 0.0;  // the pole has no precession angle
  const double dtheta = w[0] * std::cos(psi) - w[1] * std::sin(psi);
  const Eigen::Vector3d momentum = free.moments_kg_m2.cwiseProduct(w);
  const double energy = 0.5 * momentum.dot(w);
  row << t_s, angles.phi(), theta, psi, dphi, dtheta, w[2] - dphi * std::cos(theta), 0.0, 0.0, 0.0,
      energy, w[0], w[1], w[2], q[0], q[1], q[2], q[3], momentum[0], momentum[1], momentum[2],
      integral[0], integral[1], integral[2];
}

/// How far two runs are apart in attitude at every time both reached [rad].
Eigen::VectorXd attitude_differences(const Solution& a, const Solution& b) {
  const Eigen::Index rows = std::min(a.states.rows(), b.states.rows());
  return 2.0 * (a.states.topRows(rows).rightCols(4) - b.states.topRows(rows).rightCols(4))
                   .rowwise()
                   .norm();
}

}  // namespace

Trajectory simulate_free(const data::Scene& scene) {
  const FreeSettings free = settings_of(scene);
  const Choice choice = choose_integrator(scene.run.integrator);
  const std::vector<double> t_s = output_times_s(scene.run);
  int parts = 1;
  // No component of w exceeds what all the energy in the smallest moment would give.
  const Eigen::Vector3d& I = free.moments_kg_m2;
  const double fastest = std::sqrt(I.dot(free.w_rad_s.cwiseAbs2()) / I.minCoeff());
  // Between two looks an angle is taken the short way round.
  constexpr double kLargestTurn_rad = 0.5;
  const std::vector<double> fine = times_between(t_s, fastest, kLargestTurn_rad, parts);
  const Solution solution = run(free, fine, scene.run.tolerance, choice.method);
  Trajectory trajectory;
  trajectory.model = "free";
  trajectory.integrator = choice.name;
  trajectory.integrator_reason = choice.reason;
  trajectory.columns = columns();
  trajectory.error_estimate_m = std::numeric_limits<double>::quiet_NaN();
  const Eigen::Index rows = (solution.states.rows() + parts - 1) / parts;
  trajectory.values.resize(rows, static_cast<Eigen::Index>(trajectory.columns.size()));
  Angles angles(free.phi_rad, free.psi_rad);
  Eigen::RowVectorXd row(trajectory.values.cols());
  Eigen::Vector3d integral = Eigen::Vector3d::Zero();
  for (Eigen::Index n = 0; n < solution.states.rows(); ++n) {
    const auto at = static_cast<std::size_t>(n);
    if (n > 0) {  // the thesis' cumtrapz, with the time step it left out
      integral += 0.5 * (fine[at] - fine[at - 1]) *
                  (solution.states.row(n).head(3) + solution.states.row(n - 1).head(3)).transpose();
    }
    fill_row(free, fine[at], solution.states.row(n), angles, integral, row);
    if (n % parts == 0) trajectory.values.row(n / parts) = row;
  }
  trajectory.outcome = solution.outcome;
  trajectory.end_s = solution.end_s;
  trajectory.statistics = solution.statistics;
  const Eigen::VectorXd apart =
      attitude_differences(solution, run(free, fine, finer(scene.run.tolerance), choice.method));
  Eigen::VectorXd at_rows((apart.size() + parts - 1) / parts);
  for (Eigen::Index n = 0; n < at_rows.size(); ++n) at_rows[n] = apart[n * parts];
  end_where_unknown(at_rows, trajectory);
  return trajectory;
}

}  // namespace trochoid::model
