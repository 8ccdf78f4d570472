#include "study/runs.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "trochoid/data/error.hpp"
#include "trochoid/data/pose.hpp"
#include "trochoid/data/table.hpp"

namespace trochoid::tools {
namespace {

void compare(const model::Trajectory& run, const ReferenceRun& reference, StudyRun& result) {
  const data::Table table{.header = {}, .columns = run.columns, .values = run.values};
  const Eigen::VectorXd theta = table.column("theta_rad"), phi = table.column("phi_rad");
  const Eigen::VectorXd x = table.column("x_m"), y = table.column("y_m");
  const Eigen::Index rows = std::min(theta.size(), reference.t_s.size());
  for (Eigen::Index i = 0; i < rows; ++i) {
    const Eigen::Vector3d axis = data::symmetry_axis(theta[i], phi[i]);
    const double axis_error = (axis - reference.axis.row(i).transpose()).norm();
    const double path_error = std::hypot(x[i] - reference.xy_m(i, 0), y[i] - reference.xy_m(i, 1));
    // NaN must not hide behind std::max.
    result.axis_error = axis_error <= result.axis_error ? result.axis_error : axis_error;
    result.path_error_m = path_error <= result.path_error_m ? result.path_error_m : path_error;
  }
}

bool loses_energy(const data::ModelSettings& model) {
  return model.air_linear_N_m_s || model.air_quadratic_N_m_s2 || model.air_force_N_s_m ||
         model.gap_viscosity_Pa_s || model.friction || model.rolling_friction_m ||
         model.pivoting_friction_m || model.contour_friction_m || model.drag_transverse_N_m_s ||
         model.drag_spin_N_m_s || model.drag_spin_dry_N_m || model.drag_spin_quadratic_N_m_s2;
}

std::optional<double> energy_drift(const data::Scene& scene, const model::Trajectory& run) {
  const auto column = std::find(run.columns.begin(), run.columns.end(), "energy_J");
  if (column == run.columns.end() || loses_energy(scene.model) || run.values.rows() == 0)
    return std::nullopt;
  const Eigen::VectorXd energy = run.values.col(column - run.columns.begin());
  return (energy.array() - energy[0]).abs().maxCoeff<Eigen::PropagateNaN>() /
         energy.cwiseAbs().maxCoeff();
}

}  // namespace

StudyRun study_run(const data::Scene& scene, const ReferenceRun& reference, int repeats) {
  using Clock = std::chrono::steady_clock;
  StudyRun result;
  result.time_us = std::numeric_limits<double>::infinity();
  try {
    model::Trajectory run;
    for (int i = 0; i < repeats; ++i) {
      const auto start = Clock::now();
      run = model::simulate(scene);
      const std::chrono::duration<double, std::micro> elapsed = Clock::now() - start;
      result.time_us = std::min(result.time_us, elapsed.count());
    }
    result.outcome = run.outcome;
    result.statistics = run.statistics;
    result.estimate_rad = run.error_estimate_rad;
    compare(run, reference, result);
    result.energy_drift = energy_drift(scene, run);
  } catch (const model::NotOffered& error) {
    result.offered = false;
    result.refusal = error.what();
  } catch (const Error& error) {
    result.refusal = error.what();
  }
  return result;
}

}  // namespace trochoid::tools
