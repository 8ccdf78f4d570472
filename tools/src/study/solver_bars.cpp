#include "study/solver_bars.hpp"

#include <cvodes/cvodes.h>
#include <fmt/format.h>
#include <nvector/nvector_serial.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/child_process.hpp"
#include "common/scene_library.hpp"
#include "study/high_precision.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

constexpr double kA = 0.098, kB = 0.75, kL = 0.1, kTheta = data::kPi / 3.0;
constexpr double kEnd_s = 60.0;
constexpr int kOutputs = 6001;
constexpr const char *kOurs = "trochoid", *kOursWithDerivatives = "with 7 derivatives",
                     *kAdams = "CVODE Adams", *kDop853 = "scipy DOP853", *kOde45 = "Octave ode45";

/// x and y by turns, and the fastest time it took.
struct Path {
  Eigen::VectorXd xy_m;
  double time_us = 0.0;
};

double fastest_us(int repeats, const std::function<void()>& work) {
  double best = std::numeric_limits<double>::infinity();
  for (int i = 0; i < repeats; ++i) {
    const auto start = std::chrono::steady_clock::now();
    work();
    const std::chrono::duration<double, std::micro> elapsed =
        std::chrono::steady_clock::now() - start;
    best = std::min(best, elapsed.count());
  }
  return best;
}

std::vector<double> grid() {
  std::vector<double> t_s;
  for (int n = 0; n < kOutputs; ++n) t_s.push_back(kEnd_s * n / (kOutputs - 1));
  return t_s;
}

Path by_trochoid(double tolerance, bool derivatives, int repeats) {
  data::Scene scene;
  scene.model.name = "top";
  scene.start.theta_rad = kTheta;
  const auto predictor = model::make_predictor(scene);
  Eigen::VectorXd values(static_cast<Eigen::Index>(predictor->parameters().size()));
  for (Eigen::Index i = 0; i < values.size(); ++i)
    values[i] = predictor->parameters()[static_cast<std::size_t>(i)].value;
  values[predictor->index_of("a_1_s2")] = kA;
  values[predictor->index_of("b_1_s")] = kB;
  values[predictor->index_of("l_m")] = kL;
  const std::vector<double> t_s = grid();
  model::PredictRequest request;
  request.t_s = t_s;
  request.tolerance = tolerance;
  if (derivatives)
    for (const char* name :
         {"a_1_s2", "b_1_s", "l_m", "theta_rad", "phi_rad", "dtheta_rad_s", "dphi_rad_s"})
      request.derivatives.push_back(predictor->index_of(name));
  Path path;
  path.time_us =
      fastest_us(repeats, [&] { path.xy_m = predictor->predict(values, request).values; });
  return path;
}

/// phi, dphi, theta, dtheta: thesis 2.24 and 2.25, as one would write them down.
int rates(double, N_Vector state, N_Vector rate, void*) {
  const double* s = N_VGetArrayPointer(state);
  double* d = N_VGetArrayPointer(rate);
  const double sine = std::sin(s[2]), cosine = std::cos(s[2]);
  d[0] = s[1];
  d[1] = (kB - 2.0 * s[1] * cosine) * s[3] / sine;
  d[2] = s[3];
  d[3] = sine * (kA + s[1] * s[1] * cosine - kB * s[1]);
  return 0;
}

Eigen::VectorXd run_adams(double tolerance) {
  SUNContext context = nullptr;
  SUNContext_Create(nullptr, &context);
  N_Vector state = N_VNew_Serial(4, context);
  double* s = N_VGetArrayPointer(state);
  s[0] = s[1] = s[3] = 0.0;
  s[2] = kTheta;
  void* solver = CVodeCreate(CV_ADAMS, context);
  CVodeInit(solver, rates, 0.0, state);
  CVodeSStolerances(solver, tolerance, tolerance);
  CVodeSetMaxNumSteps(solver, 1000000);
  SUNNonlinearSolver iteration = SUNNonlinSol_FixedPoint(state, 0, context);
  CVodeSetNonlinearSolver(solver, iteration);
  Eigen::VectorXd xy_m(2 * kOutputs);
  int status = CV_SUCCESS;
  for (int n = 0; n < kOutputs && status >= 0; ++n) {
    double reached_s = 0.0;
    if (n > 0) status = CVode(solver, kEnd_s * n / (kOutputs - 1), state, &reached_s, CV_NORMAL);
    xy_m[2 * n] = kL * std::sin(s[2]) * std::sin(s[0]);
    xy_m[2 * n + 1] = -kL * std::sin(s[2]) * std::cos(s[0]);
  }
  SUNNonlinSolFree(iteration);
  CVodeFree(&solver);
  N_VDestroy(state);
  SUNContext_Free(&context);
  if (status < 0) throw NumericalError(fmt::format("CVODE gives up at tolerance {}", tolerance));
  return xy_m;
}

Path by_adams(double tolerance, int repeats) {
  Path path;
  path.time_us = fastest_us(repeats, [&] { path.xy_m = run_adams(tolerance); });
  return path;
}

// {0}: tolerance, {1}: repeats. The first line printed is the fastest time, then x and y.
constexpr const char* kScipy = R"(
import math, time
import numpy as np
from scipy.integrate import solve_ivp
a, b, l, grid, best = 0.098, 0.75, 0.1, np.linspace(0.0, 60.0, 6001), math.inf
def rates(t, s):
    sine, cosine = math.sin(s[2]), math.cos(s[2])
    return [s[1], (b - 2 * s[1] * cosine) * s[3] / sine, s[3],
            sine * (a + s[1] ** 2 * cosine - b * s[1])]
for _ in range({1}):
    begin = time.perf_counter()
    run = solve_ivp(rates, (0.0, 60.0), [0.0, 0.0, math.pi / 3, 0.0], method='DOP853',
                    t_eval=grid, rtol={0}, atol={0})
    best = min(best, time.perf_counter() - begin)
print(1e6 * best)
reach = l * np.sin(run.y[2])
for x, y in zip(reach * np.sin(run.y[0]), -reach * np.cos(run.y[0])):
    print('%.17g %.17g' % (x, y))
)";

constexpr const char* kOctave = R"(
a = 0.098; b = 0.75; l = 0.1; best = Inf;
rates = @(t, s) [s(2); (b - 2 * s(2) * cos(s(3))) * s(4) / sin(s(3)); s(4);
                 sin(s(3)) * (a + s(2)^2 * cos(s(3)) - b * s(2))];
options = odeset('RelTol', {0}, 'AbsTol', {0});
for k = 1:{1}
  tic; [t, s] = ode45(rates, linspace(0, 60, 6001), [0; 0; pi / 3; 0], options); best = min(best, toc);
end
printf('%.17g\n', 1e6 * best);
reach = l * sin(s(:, 3));
printf('%.17g %.17g\n', [reach .* sin(s(:, 1)), -reach .* cos(s(:, 1))]');
)";

/// Another program's answer; nothing if it is not installed or fails.
std::optional<Path> by_other(std::vector<std::string> command, const char* script, double tolerance,
                             int repeats, const fs::path& scratch) {
  command.push_back(fmt::format(fmt::runtime(script), tolerance, repeats));
  const ChildRun child = run_child(command, scratch);
  if (!child.started || child.exit_status != 0) return std::nullopt;
  std::ifstream in(scratch);
  Path path;
  in >> path.time_us;
  path.xy_m.resize(2 * kOutputs);
  for (double& value : path.xy_m) in >> value;
  return in ? std::optional(path) : std::nullopt;
}

class Comparison {
 public:
  explicit Comparison(int repeats) : repeats_(repeats) {
    const data::Scene scene = load_scene("thesis-base");
    const auto reference = high_precision_run(scene);
    if (!reference || reference->xy_m.rows() != kOutputs)
      throw NumericalError("thesis-base: no reference solution");
    exact_m_.resize(2 * kOutputs);
    for (int n = 0; n < kOutputs; ++n) exact_m_.segment<2>(2 * n) = reference->xy_m.row(n);
  }

  void run(const fs::path& scratch) {
    for (const double tolerance : {1e-9, 1e-10, 1e-11, 1e-12})
      add(kOurs, tolerance, by_trochoid(tolerance, false, repeats_));
    for (const double tolerance : {1e-10})
      add(kOursWithDerivatives, tolerance, by_trochoid(tolerance, true, repeats_));
    for (const double tolerance : {1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13})
      add(kAdams, tolerance, by_adams(tolerance, std::min(repeats_, 5)));
    constexpr int kSlow = 2;
    for (const double tolerance : {1e-8, 1e-10, 1e-12})
      for (const char* python : {"python3", "/usr/bin/python3"})
        if (const auto path = by_other({python, "-c"}, kScipy, tolerance, kSlow, scratch)) {
          add(kDop853, tolerance, *path);
          break;
        }
    for (const double tolerance : {1e-6, 1e-8, 1e-10})
      if (const auto path = by_other({"octave-cli", "--norc", "--quiet", "--eval"}, kOctave,
                                     tolerance, 1, scratch))
        add(kOde45, tolerance, *path);
    fs::remove(scratch);
  }

  void print() const {
    fmt::print("\nThe thesis' base case: 60 s, x and y at {} times, as a fit asks for them\n",
               kOutputs);
    fmt::print("{:<20} {:>9} {:>12} {:>12}\n", "by", "tolerance", "error/l", "time_us");
    for (const SolverRow& row : rows_)
      fmt::print("{:<20} {:>9.0e} {:>12.1e} {:>12.1f}\n", row.who, row.tolerance, row.error_over_l,
                 row.time_us);
    fmt::print("\n{:<52} {:>18} {:>9}\n", "bar", "", "measured");
    for (const SolverBar& bar : solver_bars(rows_)) print(bar);
  }

  void write(const fs::path& csv) const {
    std::string text = "by,tolerance,error_over_l,time_us\n";
    for (const SolverRow& row : rows_)
      text += fmt::format("{},{},{},{}\n", row.who, row.tolerance, row.error_over_l, row.time_us);
    data::write_text(text, csv);
  }

 private:
  void add(const char* who, double tolerance, const Path& path) {
    const double error = (path.xy_m - exact_m_).cwiseAbs().maxCoeff<Eigen::PropagateNaN>() / kL;
    rows_.push_back({who, tolerance, error, path.time_us});
  }

  static void print(const SolverBar& bar) {
    const std::string limit =
        fmt::format("{} {:.4g}", bar.at_least ? "at least" : "at most", bar.required);
    if (std::isnan(bar.measured))
      fmt::print("{:<52} {:>18} {:>9}  not installed\n", bar.what, limit, "-");
    else
      fmt::print("{:<52} {:>18} {:>9.4g}  {}\n", bar.what, limit, bar.measured,
                 bar.held() ? "held" : "NOT HELD");
  }

  int repeats_;
  Eigen::VectorXd exact_m_;
  std::vector<SolverRow> rows_;
};

const SolverRow& row_of(const std::vector<SolverRow>& rows, const std::string& who,
                        double tolerance) {
  const auto row = std::find_if(rows.begin(), rows.end(), [&](const SolverRow& candidate) {
    return candidate.who == who && candidate.tolerance == tolerance;
  });
  if (row == rows.end()) throw NumericalError(fmt::format("no row of {} at {}", who, tolerance));
  return *row;
}

}  // namespace

bool SolverBar::held() const {
  return at_least ? measured >= required : measured <= required;
}

double time_at_error_us(const std::vector<SolverRow>& rows, const std::string& who,
                        double error_over_l) {
  std::vector<std::pair<double, double>> points;
  for (const SolverRow& row : rows)
    if (row.who == who) points.emplace_back(std::log(row.error_over_l), std::log(row.time_us));
  if (points.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(points.begin(), points.end());
  const double at = std::log(error_over_l);
  if (at <= points.front().first) return std::exp(points.front().second);
  for (std::size_t i = 1; i < points.size(); ++i)
    if (at <= points[i].first) {
      const auto& [e0, t0] = points[i - 1];
      const auto& [e1, t1] = points[i];
      return std::exp(t0 + (t1 - t0) * (at - e0) / (e1 - e0));
    }
  return std::exp(points.back().second);
}

std::vector<SolverBar> solver_bars(const std::vector<SolverRow>& rows) {
  const SolverRow& ours = row_of(rows, kOurs, 1e-10);
  std::vector<SolverBar> bars;
  for (const auto& [who, required] : {std::pair{kAdams, 60.0}, {kDop853, 500.0}, {kOde45, 10000.0}})
    bars.push_back({fmt::format("time of {} over trochoid's, at equal error", who), true, required,
                    time_at_error_us(rows, who, ours.error_over_l) / ours.time_us});
  bars.push_back({"time with 7 derivatives over that without", false, 3.5,
                  row_of(rows, kOursWithDerivatives, 1e-10).time_us / ours.time_us});
  bars.push_back({"error/l of trochoid at 1e-10", false, 1e-9, ours.error_over_l});
  return bars;
}

void study_solver_bars(int repeats, const fs::path& csv) {
  Comparison comparison(std::max(repeats, 20));
  comparison.run(fs::path(csv).replace_extension(".part"));
  comparison.print();
  comparison.write(csv);
}

}  // namespace trochoid::tools
