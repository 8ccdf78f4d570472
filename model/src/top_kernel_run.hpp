#pragma once
#include "top_kernel_path.hpp"
#include "top_kernel_store.hpp"
#include "trochoid/model/events.hpp"
#include "trochoid/model/top.hpp"

/// The top's run over its output times, included once per instruction set.
namespace trochoid::model {
inline namespace TROCHOID_ISA {
namespace top_kernel {

constexpr double kPi = 3.14159265358979323846;

TROCHOID_INLINE double wrapped(double angle) {
  return angle - 2.0 * kPi * __builtin_floor(angle / (2.0 * kPi) + 0.5);
}

/// Errors count where they matter: in the tilt of the axis, relative to how far it can move. Near
/// the upright position the horizontal components are what grows, so their floor shrinks with them;
/// L gets the scale of its fast part b k.
template <class System>
StepControl<System::kStates> control_for(const TopRun& run, const AxisAndMomentum<double>& start) {
  const double b = __builtin_fabs(run.variable[kTopB]);
  const double root_a = __builtin_sqrt(__builtin_fabs(run.variable[kTopA]));
  const double sine = __builtin_hypot(start.k[0], start.k[1]);
  const double across = __builtin_hypot(run.variable[kTopDtheta], run.variable[kTopDphi] * sine);
  const double rate = b + root_a + across + 1e-300;
  double amplitude = sine + across / rate;
  amplitude = amplitude > 1.0 ? 1.0 : (amplitude < 1e-16 ? 1e-16 : amplitude);
  StepControl<System::kStates> control;
  control.rtol = run.tolerance;
  control.max_steps = run.max_steps;
  for (int i = 0; i < System::kStates; ++i) control.atol[i] = run.tolerance;
  for (int i = 0; i < System::kAxis; ++i) control.atol[i] = run.tolerance * amplitude * rate;
  control.atol[System::kAxis] = control.atol[System::kAxis + 1] = run.tolerance * amplitude;
  return control;
}

/// phi as a continuous angle: the axis is looked at often enough that it cannot turn by half a
/// revolution unseen, except exactly through the pole, where phi jumps by nature.
class Azimuth {
 public:
  void start(double phi_rad) { phi_ = phi_rad; }
  TROCHOID_INLINE double follow(double kx, double ky) {
    if (kx != 0.0 || ky != 0.0) phi_ += wrapped(__builtin_atan2(kx, -ky) - phi_);
    return phi_;
  }

 private:
  double phi_ = 0.0;
};

/// Whether the axis is upright to rounding: there is no azimuth then.
template <class S>
TROCHOID_INLINE bool at_pole(const S& kx, const S& ky) {
  const double x = value_of(kx), y = value_of(ky);
  return x * x + y * y == 0.0;
}

template <class S>
TROCHOID_INLINE S azimuth(const S& kx, const S& ky, double near) {
  const double phi = near;
  if constexpr (requires { S::kLanes; }) {
    if (at_pole(kx, ky)) return S(phi);
    S result = atan2(kx, -ky);
    result.value = phi;
    return result;
  } else {
    return phi;
  }
}

/// Samples between outputs at which the azimuth is followed within one step.
constexpr int kLooks = 16;

template <template <class> class Method, class System>
class Run {
 public:
  using S = typename System::Scalar;
  using Stepper = Method<System>;
  static constexpr bool kAngles = requires(System system) { system.side; };

  Run(const TopRun& run, TopResult& result) : run_(run), result_(result) {}

  void operator()() {
    const TopAngles<S> angles{variable<S>(run_, kTopTheta), S(run_.phi_rad),
                              variable<S>(run_, kTopDtheta), variable<S>(run_, kTopDphi)};
    const S b = variable<S>(run_, kTopB);
    const auto start = axis_and_momentum(angles, b);
    State<S, System::kStates> y;
    const System system = make_system(b, start, y);
    Stepper stepper(system, control(start));
    azimuth_.start(run_.phi_rad);
    stepper.start(run_.start_s, y);
    stepper.prepare_dense();
    hand_out(stepper, run_.start_s);
    StepEnd end = StepEnd::accepted;
    while (stepper.t_s() < run_.end_s) {
      end = stepper.step(next_stop_s(stepper.t_s()));
      if (end != StepEnd::accepted) break;
      after_step(stepper);
      if constexpr (requires { System::kDry; }) {
        if (System::kDry && stepper.t_s() == run_.spin_stops_s) stop_spin(stepper);
      }
    }
    finish(stepper, end);
  }

 private:
  [[nodiscard]] double next_stop_s(double t_s) const {
    return t_s < run_.spin_stops_s && run_.spin_stops_s < run_.end_s ? run_.spin_stops_s
                                                                     : run_.end_s;
  }
  /// Where dry drag has used up the spin it holds it. All states are continuous there, and the rate
  /// of no other one jumps: their derivatives go on as they are, that of the spin is gone.
  void stop_spin(Stepper& stepper) {
    auto y = stepper.y();
    y[System::kSpin] = S(0.0);
    stepper.system().sense = 0.0;
    stepper.start(stepper.t_s(), y);
  }
  System make_system(const S& b, const AxisAndMomentum<S>& start,
                     State<S, System::kStates>& y) const {
    const S a = variable<S>(run_, kTopA), gamma1 = variable<S>(run_, kTopGamma1),
            gamma3 = variable<S>(run_, kTopGamma3);
    System system;
    if constexpr (kAngles) {
      State<S, System::kAngle> base;
      static_cast<typename System::Base_&>(system) = System::at(a, b, gamma1, gamma3, start, base);
      for (int i = 0; i < System::kAngle; ++i) y[i] = base[i];
      system.side = value_of(start.k[2]) < -0.5 ? -1.0 : 1.0;
      y[System::kAngle] = S(run_.phi_rad);  // phi + psi, or phi - psi: psi counts from zero
      if constexpr (System::kCountsTurns) y[System::kTurns] = S(0.0);
    } else {
      system = System::at(a, b, gamma1, gamma3, start, y);
    }
    if constexpr (requires { system.sense; }) {
      const double spin = run_.variable[kTopB];
      // Dry drag that stops it within rounding of the start would otherwise drive it backwards.
      const bool turns = spin != 0.0 && !(run_.spin_stops_s <= run_.start_s);
      system.sense = turns ? __builtin_copysign(1.0, spin) : 0.0;
      if constexpr (System::kDry) {
        system.dry_1_s2 = variable<S>(run_, kTopDry);
        if (run_.spin_stops_s <= run_.start_s) y[System::kSpin] = S(0.0);
      }
      if constexpr (System::kQuadratic) system.quadratic = variable<S>(run_, kTopQuadratic);
    }
    return system;
  }
  [[nodiscard]] StepControl<System::kStates> control(const AxisAndMomentum<S>& start) const {
    AxisAndMomentum<double> values;
    for (int i = 0; i < 3; ++i) {
      values.k[i] = value_of(start.k[i]);
      values.L[i] = value_of(start.L[i]);
    }
    return control_for<System>(run_, values);
  }

  void after_step(Stepper& stepper) {
    const double t = stepper.t_s();
    const bool outputs = next_ < run_.count && run_.t_s[next_] <= t;
    if (outputs || kAngles) stepper.prepare_dense();
    if constexpr (kAngles) {
      for (int look = 1; look <= kLooks; ++look) {
        const double u = static_cast<double>(look) / kLooks;
        hand_out(stepper, stepper.t_previous_s() + u * stepper.step_s());
        azimuth_.follow(stepper.dense_value(System::kAxis, u),
                        stepper.dense_value(System::kAxis + 1, u));
      }
      hand_out(stepper, t);
      change_side(stepper);
    } else {
      if (outputs) hand_out(stepper, t);
    }
  }
  void hand_out(Stepper& stepper, double until) {
    const int first = next_;
    while (next_ < run_.count && run_.t_s[next_] <= until) ++next_;
    if constexpr (requires { stepper.series(0); }) {
      if (result_.path.xy != nullptr) {
        write_path(stepper.series(System::kAxis), stepper.series(System::kAxis + 1),
                   stepper.t_previous_s(), run_.t_s, first, next_, result_.path);
        return;
      }
    }
    for (int n = first; n < next_; ++n) write(stepper, n, stepper.fraction(run_.t_s[n]));
  }
  void write(Stepper& stepper, int n, double u) {
    const S kx = stepper.dense(System::kAxis, u), ky = stepper.dense(System::kAxis + 1, u);
    store(result_, 0, n, kx);
    store(result_, 1, n, ky);
    store(result_, 2, n, stepper.dense(System::kAxis + 2, u));
    if constexpr (kAngles) {
      const S phi = azimuth(kx, ky, azimuth_.follow(value_of(kx), value_of(ky)));
      store(result_, 3, n, phi);
      store(result_, 4, n, spin_angle(stepper, phi, stepper.dense(System::kAngle, u)));
      if constexpr (System::kCountsTurns)
        store(result_, kTopTurns, n, stepper.dense(System::kTurns, u));
    }
    if (result_.value[kTopAngleColumns] != nullptr) write_momentum(stepper, n, u);
  }
  void write_momentum(Stepper& stepper, int n, double u) {
    const auto [state, b] = unpack(stepper.system(), stepper.dense_state(u));
    for (int i = 0; i < 3; ++i) store(result_, kTopAngleColumns + i, n, state.L[i]);
    store(result_, kTopAngleColumns + 3, n, b);
  }
  struct Unpacked {
    AxisAndMomentum<S> state;
    S b;
  };
  [[nodiscard]] static Unpacked unpack(const System& system, const State<S, System::kStates>& y) {
    if constexpr (kAngles) {
      const auto base = System::base(y);
      return {system.unpack(base), system.spin(base)};
    } else {
      return {system.unpack(y), system.spin(y)};
    }
  }
  [[nodiscard]] S spin_angle(const Stepper& stepper, const S& phi, const S& combined) const {
    return stepper.system().side > 0.0 ? combined - phi : phi - combined;
  }
  /// Below -0.5 use phi - psi, above +0.5 phi + psi: each is regular there (9).
  void change_side(Stepper& stepper) {
    const double kz = value_of(stepper.y()[System::kAxis + 2]);
    const double side = stepper.system().side;
    if (side * kz > -0.5) return;
    auto y = stepper.y();
    const S kx = y[System::kAxis], ky = y[System::kAxis + 1];
    const S phi = azimuth(kx, ky, azimuth_.follow(value_of(kx), value_of(ky)));
    y[System::kAngle] = 2.0 * phi - y[System::kAngle];
    stepper.system().side = -side;
    stepper.start(stepper.t_s(), y);
  }

  void finish(Stepper& stepper, StepEnd end) {
    result_.written = next_;
    result_.end_reason = static_cast<int>(run_end_of(end));
    result_.reached_s = stepper.t_s();
    const StepCounts& counts = stepper.counts();
    result_.steps = counts.steps;
    result_.rejected = counts.rejected;
    result_.evaluations = counts.evaluations;
    store_end_state(stepper);
  }
  /// As angles_of(), where the axis is upright: of the azimuth there is what it was before, of its
  /// rate nothing. The tilt grows by how far the axis moves, to whatever side.
  [[nodiscard]] TopAngles<S> angles_at_pole(const AxisAndMomentum<S>& state) {
    const double phi = azimuth_.follow(0.0, 0.0), side = value_of(state.k[2]) < 0.0 ? -1.0 : 1.0;
    S theta(side < 0.0 ? kPi : 0.0);
    if constexpr (requires { S::kLanes; }) {
      for (int lane = 0; lane < S::kLanes; ++lane)
        set_lane(theta.derivative, lane,
                 side * __builtin_hypot(state.k[0].derivative[lane], state.k[1].derivative[lane]));
    }
    return {theta, S(phi), state.L[0] * __builtin_cos(phi) + state.L[1] * __builtin_sin(phi),
            S(0.0)};
  }

  void store_end_state(Stepper& stepper) {
    const auto& y = stepper.y();
    const auto [state, b] = unpack(stepper.system(), y);
    const TopAngles<S> angles =
        at_pole(state.k[0], state.k[1]) ? angles_at_pole(state) : angles_of(state);
    S phi = angles.phi_rad;
    if constexpr (kAngles) {
      phi = azimuth(state.k[0], state.k[1],
                    azimuth_.follow(value_of(state.k[0]), value_of(state.k[1])));
      store_end(result_, 5, spin_angle(stepper, phi, y[System::kAngle]));
      if constexpr (System::kCountsTurns) store_end(result_, 6, y[System::kTurns]);
    }
    store_end(result_, 0, angles.theta_rad);
    store_end(result_, 1, phi);
    store_end(result_, 2, angles.dtheta_rad_s);
    store_end(result_, 3, angles.dphi_rad_s);
    store_end(result_, 4, b);
  }

  const TopRun& run_;
  TopResult& result_;
  Azimuth azimuth_;
  int next_ = 0;
};

template <template <class> class Method, class System>
void run_system(const TopRun& run, TopResult& result) {
  if (run.with_angles) {
    Run<Method, WithSpinAngle<System>>(run, result)();
  } else {
    Run<Method, System>(run, result)();
  }
}

/// @tparam S, Wide  scalars of 8 lanes and of 16, or plain numbers.
template <template <class> class Method, class S, class Wide>
void run_with(const TopRun& run, TopResult& result) {
  if (run.dry && run.quadratic) {
    run_system<Method, TopWithDrag<Wide, true, true>>(run, result);
  } else if (run.quadratic) {
    run_system<Method, TopWithDrag<Wide, false, true>>(run, result);
  } else if (run.dry) {
    run_system<Method, TopWithDrag<S, true, false>>(run, result);
  } else if (run.drag) {
    run_system<Method, TopWithDrag<S>>(run, result);
  } else {
    run_system<Method, Top<S>>(run, result);
  }
}

}  // namespace top_kernel

/// By Taylor series.
void run_top(const TopRun& run, TopResult& result) {
  if (run.with_derivatives) {
    top_kernel::run_with<Taylor, Dual<kTopLanes>, Dual<kTopMostLanes>>(run, result);
  } else {
    top_kernel::run_with<Taylor, double, double>(run, result);
  }
}

}  // namespace TROCHOID_ISA
}  // namespace trochoid::model
