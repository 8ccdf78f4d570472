#include <benchmark/benchmark.h>

#include <cmath>
#include <string>
#include <vector>

#include "solve.hpp"
#include "top_dispatch.hpp"
#include "trochoid/model/predictor.hpp"
#include "trochoid/model/top.hpp"

// The thesis' base case, 60 s: how long, and how exact. Every row prints its largest error in x/l,
// y/l against a run at 1e-15 beside its time; compare rows of one run only.
namespace trochoid::model {
namespace {

constexpr double kA = 0.098, kB = 0.75, kL = 0.1, kTheta = M_PI / 3.0, kEnd_s = 60.0;

std::vector<double> grid() {
  std::vector<double> t_s;
  for (int n = 0; n <= 6000; ++n) t_s.push_back(0.01 * n);
  return t_s;
}

data::Scene base_case() {
  data::Scene scene;
  scene.model.name = "top";
  scene.start.theta_rad = kTheta;
  return scene;
}

Eigen::VectorXd base_values(const Predictor& predictor) {
  Eigen::VectorXd values(predictor.parameters().size());
  for (std::size_t i = 0; i < predictor.parameters().size(); ++i)
    values[static_cast<Eigen::Index>(i)] = predictor.parameters()[i].value;
  values[predictor.index_of("a_1_s2")] = kA;
  values[predictor.index_of("b_1_s")] = kB;
  values[predictor.index_of("l_m")] = kL;
  return values;
}

const Eigen::VectorXd& exact() {
  static const Eigen::VectorXd values = [] {
    const auto predictor = make_predictor(base_case());
    const std::vector<double> t_s = grid();
    PredictRequest request;
    request.t_s = t_s;
    request.tolerance = 1e-15;
    return predictor->predict(base_values(*predictor), request).values;
  }();
  return values;
}

void report_error(benchmark::State& state, const Eigen::VectorXd& path) {
  state.counters["error_over_l"] = (path - exact()).cwiseAbs().maxCoeff() / kL;
}

void predictor_path(benchmark::State& state, const std::vector<std::string>& by) {
  const auto predictor = make_predictor(base_case());
  const Eigen::VectorXd values = base_values(*predictor);
  const std::vector<double> t_s = grid();
  PredictRequest request;
  request.t_s = t_s;
  request.tolerance = std::pow(10.0, -static_cast<double>(state.range(0)));
  for (const std::string& name : by) request.derivatives.push_back(predictor->index_of(name));
  Prediction run;
  for (auto _ : state) {
    run = predictor->predict(values, request);
    benchmark::DoNotOptimize(run.values.data());
  }
  report_error(state, run.values);
  state.counters["steps"] = run.steps;
}
void value(benchmark::State& state) {
  predictor_path(state, {});
}
void value_and_7_derivatives(benchmark::State& state) {
  predictor_path(state,
                 {"a_1_s2", "b_1_s", "l_m", "theta_rad", "phi_rad", "dtheta_rad_s", "dphi_rad_s"});
}
BENCHMARK(value)->Arg(6)->Arg(9)->Arg(10)->Arg(12)->Arg(13)->Unit(benchmark::kMicrosecond);
BENCHMARK(value_and_7_derivatives)->Arg(9)->Arg(10)->Unit(benchmark::kMicrosecond);

/// The kernel alone, to the end time without outputs.
void end_point_only(benchmark::State& state) {
  TopRun run;
  const double variables[kTopVariables] = {kA, kB, 0.0, 0.0, kTheta, 0.0, 0.0};
  for (int i = 0; i < kTopVariables; ++i) run.variable[i] = variables[i];
  run.end_s = kEnd_s;
  run.tolerance = std::pow(10.0, -static_cast<double>(state.range(0)));
  TopResult result;
  for (auto _ : state) {
    run_top_here(run, result);
    benchmark::DoNotOptimize(result.end);
  }
  state.counters["theta_error_rad"] = std::abs(result.end[0] - 1.408783727431625);
  state.counters["steps"] = result.steps;
}
BENCHMARK(end_point_only)->Arg(10)->Arg(13)->Unit(benchmark::kMicrosecond);

template <class T>
struct PlainTop : Top<T> {
  [[nodiscard]] PlainTop<double> values() const {
    return {Top<double>{value_of(this->a_1_s2), value_of(this->lz_1_s), value_of(this->b_1_s)}};
  }
};

PlainTop<Dual<8>> dual_system() {
  return {Top<Dual<8>>{Dual<8>(kA), Dual<8>(kB * std::cos(kTheta)), Dual<8>(kB)}};
}

State<double, 5> start() {
  const auto s = axis_and_momentum<double>({kTheta, 0.0, 0.0, 0.0}, kB);
  return {{s.L[0], s.L[1], s.k[0], s.k[1], s.k[2]}};
}

void report_axis(benchmark::State& state, const Eigen::MatrixXd& states, double steps) {
  Eigen::VectorXd path(2 * states.rows());
  for (Eigen::Index n = 0; n < states.rows(); ++n) {
    path[2 * n] = kL * states(n, 2);
    path[2 * n + 1] = kL * states(n, 3);
  }
  report_error(state, path);
  state.counters["steps"] = steps;
}

double tolerance_of(const benchmark::State& state) {
  return std::pow(10.0, -static_cast<double>(state.range(0)));
}

/// The same equations and grid through our Runge-Kutta stepper.
void dop853(benchmark::State& state) {
  const std::vector<double> t_s = grid();
  const auto duals = dual_system();
  Solution solution;
  for (auto _ : state) {
    solution = solve(duals.values(), duals, start(), t_s, uniform_control<5>(tolerance_of(state)),
                     Method::dop853);
    benchmark::DoNotOptimize(solution.states.data());
  }
  report_axis(state, solution.states, solution.statistics.steps);
}
BENCHMARK(dop853)->Arg(10)->Arg(12)->Unit(benchmark::kMicrosecond);

/// And through SUNDIALS, outputs interpolated by SUNDIALS itself.
void sundials(benchmark::State& state, SundialsMethod method) {
  const std::vector<double> t_s = grid();
  const Ode ode = make_ode(dual_system());
  const auto y = start();
  const Eigen::VectorXd y0 = Eigen::Map<const Eigen::VectorXd>(y.v, 5);
  SundialsOptions options;
  options.method = method;
  options.rtol = tolerance_of(state);
  options.atol = Eigen::VectorXd::Constant(5, options.rtol);
  options.interpolate = true;
  SundialsRun run;
  for (auto _ : state) {
    run = integrate_sundials(ode, 0.0, y0, t_s, options);
    benchmark::DoNotOptimize(run.states.data());
  }
  report_axis(state, run.states, static_cast<double>(run.steps));
}
void cvode_adams(benchmark::State& state) {
  sundials(state, SundialsMethod::cvode_adams);
}
void arkode_erk(benchmark::State& state) {
  sundials(state, SundialsMethod::arkode_erk);
}
// Tolerances at which they come near 1e-9 .. 1e-10 in x/l.
BENCHMARK(cvode_adams)->Arg(10)->Arg(11)->Arg(12)->Unit(benchmark::kMicrosecond);
BENCHMARK(arkode_erk)->Arg(10)->Arg(12)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace trochoid::model

BENCHMARK_MAIN();
