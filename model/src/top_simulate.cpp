#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "decay.hpp"
#include "factories.hpp"
#include "solve.hpp"
#include "top_dispatch.hpp"
#include "top_scene.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/model/top.hpp"

// A whole run of the top as a table. Our own steppers run in the kernel; SUNDIALS runs the same
// system.
namespace trochoid::model {
namespace {

/// The kernel's columns (top_kernel.hpp) with the storage they need.
struct TopColumns {
  std::vector<double> t_s;
  std::array<std::vector<double>, kTopColumns> column;
  TopResult result;
  Outcome outcome = Outcome::reached_end;
  int rows = 0;

  explicit TopColumns(const std::vector<double>& times) : t_s(times) {
    for (int c = 0; c < kTopColumns; ++c) {
      column[c].resize(t_s.size());
      result.value[c] = column[c].data();
    }
  }
};

TopRun kernel_run(const TopSettings& top, double tolerance) {
  TopRun run;
  run.variable[kTopA] = top.a_1_s2;
  run.variable[kTopB] = top.b_1_s;
  run.variable[kTopGamma1] = top.gamma1_1_s;
  run.variable[kTopGamma3] = top.gamma3_1_s;
  run.variable[kTopDry] = top.dry_1_s2;
  run.variable[kTopQuadratic] = top.quadratic;
  run.variable[kTopTheta] = top.theta_rad;
  run.variable[kTopDtheta] = top.dtheta_rad_s;
  run.variable[kTopDphi] = top.dphi_rad_s;
  run.phi_rad = top.phi_rad;
  run.drag = top.drag;
  run.dry = top.dry_drag;
  run.quadratic = top.quadratic_drag;
  run.spin_stops_s = spin_lasts_s(top.b_1_s, top.dry_1_s2, top.gamma3_1_s, top.quadratic);
  run.with_angles = true;
  run.tolerance = tolerance;
  return run;
}

using Kernel = void (*)(const TopRun&, TopResult&);

TopColumns run_kernel(Kernel kernel, const TopSettings& top, const std::vector<double>& t_s,
                      double tolerance) {
  TopColumns columns(t_s);
  TopRun run = kernel_run(top, tolerance);
  run.t_s = t_s.data();
  run.count = static_cast<int>(t_s.size());
  run.end_s = t_s.back();
  kernel(run, columns.result);
  columns.rows = columns.result.written;
  columns.outcome = outcome_of(static_cast<RunEnd>(columns.result.end_reason));
  return columns;
}

template <class S>
WithSpinAngle<TopWithDrag<S>> system_of(const TopSettings& top, double side) {
  WithSpinAngle<TopWithDrag<S>> system;
  system.side = side;
  system.a_1_s2 = S(top.a_1_s2);
  system.gamma1_1_s = S(top.gamma1_1_s);
  system.gamma3_1_s = S(top.gamma3_1_s);
  return system;
}

struct DualTop : WithSpinAngle<TopWithDrag<Dual<8>>> {
  [[nodiscard]] WithSpinAngle<TopWithDrag<double>> values() const {
    WithSpinAngle<TopWithDrag<double>> system;
    system.side = side;
    system.a_1_s2 = a_1_s2.value;
    system.gamma1_1_s = gamma1_1_s.value;
    system.gamma3_1_s = gamma3_1_s.value;
    return system;
  }
};

/// @param side  which combination of (9) tells the spin angle.
/// @returns nothing where the axis comes so near to the pole at which that is singular that a step
///          might pass over it.
std::optional<TopColumns> run_sundials_by(double side, const TopSettings& top,
                                          const std::vector<double>& t_s, double tolerance,
                                          Method method) {
  TopColumns columns(t_s);
  const auto start = axis_and_momentum<double>(
      {top.theta_rad, top.phi_rad, top.dtheta_rad_s, top.dphi_rad_s}, top.b_1_s);
  const double rate = std::abs(top.b_1_s) + 2.0 * std::sqrt(std::abs(top.a_1_s2)) +
                      std::abs(top.dphi_rad_s) + std::abs(top.dtheta_rad_s);
  int parts = 1;
  // The azimuth is followed from one look to the next; near the vertical it turns fastest.
  constexpr double kLargestTurn_rad = 0.25;
  const double singular = -std::cos(1.2 * kLargestTurn_rad);
  const std::vector<double> fine = times_between(t_s, rate, kLargestTurn_rad, parts);
  StepControl<8> control = uniform_control<8>(tolerance);
  for (int i = 0; i < 3; ++i) control.atol[i] *= rate;
  State<double, 7> base;
  const auto axis =
      TopWithDrag<double>::at(top.a_1_s2, top.b_1_s, top.gamma1_1_s, top.gamma3_1_s, start, base);
  State<double, 8> y0;
  for (int i = 0; i < 7; ++i) y0[i] = base[i];
  y0[7] = top.phi_rad;
  DualTop duals;
  static_cast<WithSpinAngle<TopWithDrag<Dual<8>>>&>(duals) = system_of<Dual<8>>(top, side);
  const Solution solution = solve(system_of<double>(top, side), duals, y0, fine, control, method);
  double phi = top.phi_rad;
  for (Eigen::Index row = 0; row < solution.states.rows(); ++row) {
    const auto y = solution.states.row(row);
    if (side * y[5] < singular) return std::nullopt;
    const double raw = std::atan2(y[3], -y[4]);
    if (y[3] != 0.0 || y[4] != 0.0) phi += data::wrapped(raw - phi);
    if (row % parts != 0) continue;
    const auto n = static_cast<std::size_t>(row / parts);
    for (int i = 0; i < 7; ++i) base[i] = y[i];
    const auto at = axis.unpack(base);
    for (int i = 0; i < 3; ++i) {
      columns.column[i][n] = at.k[i];
      columns.column[kTopAngleColumns + i][n] = at.L[i];
    }
    columns.column[3][n] = phi;
    columns.column[4][n] = side * (y[7] - phi);
    columns.rows = static_cast<int>(n) + 1;
  }
  columns.outcome = solution.outcome;
  columns.result.reached_s = solution.end_s;
  columns.result.steps = solution.statistics.steps;
  columns.result.rejected = solution.statistics.rejected;
  columns.result.evaluations = solution.statistics.evaluations;
  return columns;
}

TopColumns run_sundials(const TopSettings& top, const std::vector<double>& t_s, double tolerance,
                        Method method) {
  constexpr const char* kOurs = "run.integrator = \"auto\", \"taylor\" or \"dop853\"";
  if (top.dry_drag || top.quadratic_drag)
    throw NotOffered(
        fmt::format("SUNDIALS runs a top with linear drag only; drag_spin_dry_N_m and "
                    "drag_spin_quadratic_N_m_s2 take {}",
                    kOurs));
  const double nearer = std::cos(top.theta_rad) < 0.0 ? -1.0 : 1.0;
  for (const double side : {nearer, -nearer})
    if (auto columns = run_sundials_by(side, top, t_s, tolerance, method))
      return *std::move(columns);
  throw NotOffered(fmt::format(
      "SUNDIALS follows a top's spin angle near one of the poles, theta_rad = 0 and pi, only; this "
      "top, which comes near both, takes {}",
      kOurs));
}

/// How far the axes of two runs are apart at every time both reached [rad].
Eigen::VectorXd axis_differences(const TopColumns& a, const TopColumns& b) {
  Eigen::VectorXd apart(std::min(a.rows, b.rows));
  for (Eigen::Index n = 0; n < apart.size(); ++n) {
    const auto at = static_cast<std::size_t>(n);
    double squared = 0.0;
    for (int i = 0; i < 3; ++i) {
      const double d = a.column[i][at] - b.column[i][at];
      squared += d * d;
    }
    apart[n] = std::sqrt(squared);
  }
  return apart;
}

/// Spin rate and how far the top has turned since the start.
struct Spin {
  double rate_rad_s, turned_rad;
};
Spin spin_at(const TopSettings& top, const TopColumns& run, int n) {
  const double t_s = run.t_s[n], omega_s = top.omega_s_rad_s;
  if ((top.dry_drag || top.quadratic_drag) && top.b_1_s != 0.0) {
    const double per_b = omega_s / top.b_1_s;
    return {per_b * run.column[kTopAngleColumns + 3][n], per_b * run.column[kTopTurns][n]};
  }
  return {omega_s * std::exp(-top.gamma3_1_s * t_s), omega_s * decay(top.gamma3_1_s, t_s).integral};
}

/// One row: angles, rates and energy from axis and momentum, (8) and (11).
void fill_row(const TopSettings& top, const TopColumns& run, int n, double pivot_z_m,
              Eigen::Ref<Eigen::RowVectorXd> row) {
  const auto& c = run.column;
  const AxisAndMomentum<double> state{
      {c[0][n], c[1][n], c[2][n]},
      {c[kTopAngleColumns][n], c[kTopAngleColumns + 1][n], c[kTopAngleColumns + 2][n]}};
  TopAngles<double> angles = angles_of(state);
  const double s = std::hypot(state.k[0], state.k[1]);
  const double across[3] = {state.L[1] * state.k[2] - state.L[2] * state.k[1],
                            state.L[2] * state.k[0] - state.L[0] * state.k[2],
                            state.L[0] * state.k[1] - state.L[1] * state.k[0]};
  const double speed2 = across[0] * across[0] + across[1] * across[1] + across[2] * across[2];
  if (s == 0.0) {  // upright to rounding: no precession angle, the tilt grows as k moves
    angles.dphi_rad_s = 0.0;
    angles.dtheta_rad_s = std::sqrt(speed2);
  }
  const Spin spin = spin_at(top, run, n);
  const double psi = top.psi_rad + c[4][n] + spin.turned_rad;
  const double energy = 0.5 * top.I_kg_m2 * speed2 +
                        0.5 * top.Is_kg_m2 * spin.rate_rad_s * spin.rate_rad_s +
                        top.weight_times_l_J * state.k[2];
  row << run.t_s[n], c[3][n], angles.theta_rad, psi, angles.dphi_rad_s, angles.dtheta_rad_s,
      spin.rate_rad_s - angles.dphi_rad_s * state.k[2], top.pivot_x_m + top.l_m * state.k[0],
      top.pivot_y_m + top.l_m * state.k[1], pivot_z_m + top.l_m * state.k[2], energy;
}

template <class Runner>
Trajectory tabulate(const char* model, const data::Scene& scene, const TopSettings& top,
                    const Choice& choice, const Runner& run) {
  const std::vector<double> t_s = output_times_s(scene.run);
  const TopColumns columns = run(t_s, scene.run.tolerance);
  Trajectory trajectory;
  trajectory.model = model;
  trajectory.integrator = choice.name;
  trajectory.integrator_reason = choice.reason;
  trajectory.columns = euler_columns();
  trajectory.values.resize(columns.rows, static_cast<Eigen::Index>(trajectory.columns.size()));
  const double pivot_z_m = scene.support.pivot_m ? scene.support.pivot_m->z() : 0.0;
  Eigen::RowVectorXd row(trajectory.values.cols());
  for (int n = 0; n < columns.rows; ++n) {
    fill_row(top, columns, n, pivot_z_m, row);
    trajectory.values.row(n) = row;
  }
  trajectory.outcome = columns.outcome;
  trajectory.end_s = columns.result.reached_s;
  trajectory.statistics = {columns.result.steps, columns.result.rejected,
                           columns.result.evaluations};
  end_where_unknown(axis_differences(columns, run(t_s, finer(scene.run.tolerance))), trajectory);
  trajectory.error_estimate_m = top.l_m * trajectory.error_estimate_rad;
  return trajectory;
}

}  // namespace

Trajectory simulate_top(const data::Scene& scene) {
  const TopSettings top = top_for_simulation(scene);
  const Choice choice = choose_integrator(scene.run.integrator);
  return tabulate("top", scene, top, choice, [&](const std::vector<double>& t_s, double tolerance) {
    if (choice.method == Method::taylor) return run_kernel(run_top_here, top, t_s, tolerance);
    if (choice.method == Method::dop853) return run_kernel(run_top_dop853, top, t_s, tolerance);
    return run_sundials(top, t_s, tolerance, choice.method);
  });
}

Trajectory simulate_top_euler(const data::Scene& scene) {
  const TopSettings top = without_drag(top_for_simulation(scene));
  const Choice choice{Method::dop853, "dop853", "the only one for the thesis' form"};
  return tabulate("top-euler", scene, top, choice,
                  [&](const std::vector<double>& t_s, double tolerance) {
                    return run_kernel(run_top_euler, top, t_s, tolerance);
                  });
}

}  // namespace trochoid::model
