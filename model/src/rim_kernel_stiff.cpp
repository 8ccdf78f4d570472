#include "rim_kernel.hpp"

namespace trochoid::model {
namespace {

/// Beside a stiff solver's linear algebra terms that are zero cost nothing: one list holds them
/// all.
template <class S>
using Stiff = Sliding<S, Coulomb, LinearAir, QuadraticAir, AirForce, GapLayer, RollingFriction,
                      PivotingFriction, ContourFriction>;
template <class S>
using Held = Rolling<S, LinearAir, QuadraticAir, AirForce, GapLayer, RollingFriction,
                     PivotingFriction, ContourFriction>;
constexpr int kStates = Stiff<double>::kStates;

template <class S, class From>
Stiff<S> stiff_system(const RimModel& model, const RimInput<From>& input) {
  Stiff<S> system;
  place(model, input, system);
  if constexpr (std::is_same_v<S, From>)
    system.friction = {input.friction, input.eps_v};
  else
    system.friction = {S(value_of(input.friction)), S(value_of(input.eps_v))};
  return system;
}

State<double, kStates> numbers(const State<double, kStates>& y) {
  return y;
}
State<double, kStates> numbers(const State<Dual8, kStates>& y) {
  State<double, kStates> result;
  for (int i = 0; i < kStates; ++i) result[i] = y[i].value;
  return result;
}

/// One evaluation over Dual8 gives df/dy s + df/dp for eight parameters at once.
Sensitivities sensitivities_of(const RimModel& model, const RimInput<Dual8>& input,
                               const State<Dual8, kStates>& start) {
  Sensitivities s;
  s.start.resize(kStates, Dual8::kLanes);
  for (int i = 0; i < kStates; ++i)
    for (int p = 0; p < Dual8::kLanes; ++p) s.start(i, p) = start[i].derivative[p];
  s.derivative = [system = stiff_system<Dual8>(model, input)](double t_s, const double* y,
                                                              const double* from, double* rate) {
    State<Dual8, kStates> state, change;
    for (int i = 0; i < kStates; ++i) {
      state[i] = Dual8(y[i]);
      for (int p = 0; p < Dual8::kLanes; ++p) state[i].derivative[p] = from[i + p * kStates];
    }
    system.derivative(t_s, state, change);
    for (int i = 0; i < kStates; ++i)
      for (int p = 0; p < Dual8::kLanes; ++p) rate[i + p * kStates] = change[i].derivative[p];
  };
  return s;
}

using Row = Eigen::Ref<const Eigen::RowVectorXd, 0, Eigen::InnerStride<>>;

State<double, kStates> state_of(const Row& states, const Row&, double) {
  State<double, kStates> y;
  for (int i = 0; i < kStates; ++i) y[i] = states[i];
  return y;
}
State<Dual8, kStates> state_of(const Row& states, const Row& sensitivities, const Dual8&) {
  State<Dual8, kStates> y;
  for (int i = 0; i < kStates; ++i) {
    y[i] = Dual8(states[i]);
    for (int p = 0; p < Dual8::kLanes; ++p) y[i].derivative[p] = sensitivities[i + p * kStates];
  }
  return y;
}

/// The state a body fell flat in: the derivatives at that instant, and those of the instant.
State<double, kStates> fallen(const RimModel&, const RimInput<double>&,
                              const State<double, kStates>& y, double) {
  return y;
}
State<Dual8, kStates> fallen(const RimModel& model, const RimInput<Dual8>& input,
                             const State<Dual8, kStates>& y, double t_s) {
  const auto system = stiff_system<Dual8>(model, input);
  State<Dual8, kStates> slope;
  system.derivative(t_s, y, slope);
  const Dual8& theta = y[Rim::theta];
  const double rate = std::cos(theta.value) * slope[Rim::theta].value;
  return moved_to_event(system, t_s, y, event_delay(sin(theta), rate));
}

}  // namespace

double explicit_steps(const RimModel& model, const Coulomb<double>& friction, double duration_s) {
  if (friction.eps_v == 0.0) return 0.0;
  constexpr double kStability = 6.0;
  const RimBody& b = model.body;
  const double rate = friction.mu * b.m * b.g / friction.eps_v *
                      (1.0 / b.m + b.R * b.R / b.C + (b.h * b.h + b.R * b.R) / b.A);
  return rate * duration_s / kStability;
}

template <class S>
RimPath<S> run_stiff(const RimModel& model, const RimInput<S>& input, const RimRunOptions& given,
                     std::span<const double> t_s) {
  // Over a spin's many turns BDF ends some thousand times as far off as the explicit method does at
  // one tolerance, by whole radians; and with derivatives elsewhere than without. Below the finest
  // it reaches in reasonable time that is what remains.
  constexpr double kAsGood = 1e-3, kReasonable = 1e-11;
  RimRunOptions options = given;
  options.tolerance = std::min(given.tolerance, std::max(kAsGood * given.tolerance, kReasonable));
  const State<S, kStates> start =
      options.rolls_at_first ? rolling_state<Held<S>>(model, input) : rim_state(model.body, input);
  Ode ode = rim_ode(stiff_system<double>(model, input), stiff_system<Dual<16>>(model, input));
  if constexpr (std::is_same_v<S, Dual8>) ode.sensitivities = sensitivities_of(model, input, start);
  StepControl<kStates> control = rim_control<kStates>(model.body, options);
  resolve_stick(value_of(input.eps_v), control);
  SundialsOptions sundials;
  sundials.method = SundialsMethod::cvode_bdf;
  constexpr double kFinest = 1e-14;
  sundials.rtol = std::max(control.rtol, kFinest);
  sundials.atol = Eigen::Map<const Eigen::VectorXd>(control.atol, kStates);
  sundials.max_steps = options.max_steps;
  const State<double, kStates> y = numbers(start);
  const SundialsRun run =
      integrate_sundials(ode, 0.0, Eigen::Map<const Eigen::VectorXd>(y.v, kStates), t_s, sundials);

  constexpr int kComponents[] = {Rim::phi, Rim::theta, Rim::psi, Rim::x, Rim::y};
  RimPath<S> path;
  path.end.y = start;
  for (Eigen::Index row = 0; row < run.states.rows(); ++row) {
    path.end.y = state_of(run.states.row(row), run.sensitivities.row(row), S(0.0));
    State<S, 5> seen;
    for (int c = 0; c < 5; ++c) seen[c] = path.end.y[kComponents[c]];
    path.rows.push_back(seen);
  }
  path.end.regime = Regime::sliding;
  path.end.side = std::cos(value_of(input.theta)) < 0.0 ? -1.0 : 1.0;
  path.end.error_sum = static_cast<double>(run.steps);
  note_end(run, path.end);
  if (path.end.outcome == Outcome::flat)
    path.end.y = fallen(
        model, input,
        state_of(run.end_state.transpose(), run.end_sensitivities.transpose(), S(0.0)), run.end_s);
  return path;
}

template RimPath<double> run_stiff(const RimModel&, const RimInput<double>&, const RimRunOptions&,
                                   std::span<const double>);
template RimPath<Dual8> run_stiff(const RimModel&, const RimInput<Dual8>&, const RimRunOptions&,
                                  std::span<const double>);

}  // namespace trochoid::model
