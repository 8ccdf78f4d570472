#include "top_dispatch.hpp"
#include "top_kernel_store.hpp"
#include "trochoid/model/events.hpp"
#include "trochoid/model/top.hpp"

// The thesis' equations in Euler angles behind the same interface as the vector form.
namespace trochoid::model {
namespace {

using namespace top_kernel;

template <class S>
void write(TopResult& result, int n, const State<S, 5>& y, const S& b) {
  const auto state = axis_and_momentum<S>({y[1], y[0], y[3], y[2]}, b);
  const auto put = [&](int column, const S& x) { store(result, column, n, x); };
  for (int i = 0; i < 3; ++i) put(i, state.k[i]);
  put(3, y[0]);
  put(4, y[4]);
  for (int i = 0; i < 3; ++i) put(kTopAngleColumns + i, state.L[i]);
  put(kTopAngleColumns + 3, b);
}

template <class S>
void run_with(const TopRun& run, TopResult& result) {
  const S b = variable<S>(run, kTopB);
  const TopEuler<S> system{variable<S>(run, kTopA), b};
  // Rates get the scale of the spin, so that a fast top's do not set the step alone.
  StepControl<5> control = uniform_control<5>(run.tolerance);
  control.max_steps = run.max_steps;
  const double rate = __builtin_fabs(run.variable[kTopB]);
  control.atol[2] = control.atol[3] = run.tolerance * (rate > 1.0 ? rate : 1.0);
  DormandPrince<TopEuler<S>> stepper(system, control);
  stepper.start(run.start_s, {{S(run.phi_rad), variable<S>(run, kTopTheta),
                               variable<S>(run, kTopDphi), variable<S>(run, kTopDtheta), S(0.0)}});
  const auto end =
      integrate(stepper, run.end_s, run.t_s, run.count, [&](const auto& step, int first, int last) {
        for (int n = first; n < last; ++n)
          write<S>(result, n, step.dense_state(step.fraction(run.t_s[n])), b);
        result.written = last;
      });
  result.end_reason = static_cast<int>(end.end);
  result.reached_s = end.t_s;
  const StepCounts& counts = stepper.counts();
  result.steps = counts.steps;
  result.rejected = counts.rejected;
  result.evaluations = counts.evaluations;
  const S last[kTopEndValues] = {end.y[1], end.y[0], end.y[3], end.y[2], b, end.y[4]};
  for (int i = 0; i < kTopEndValues; ++i) store_end(result, i, last[i]);
}

}  // namespace

void run_top_euler(const TopRun& run, TopResult& result) {
  if (run.with_derivatives) {
    run_with<Dual<kTopLanes>>(run, result);
  } else {
    run_with<double>(run, result);
  }
}

}  // namespace trochoid::model
