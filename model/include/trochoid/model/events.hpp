#pragma once
#include "trochoid/model/dormand_prince.hpp"
#include "trochoid/model/outcome.hpp"

/// Runs a stepper to an end time, hands out the output times each step covers, and finds events.
/// At a terminal event the run stops on the event; restart with across_event() and start().
namespace trochoid::model {
inline namespace TROCHOID_ISA {

struct EventRule {
  int direction = 0;     ///< +1: only where g rises through zero, -1: falls, 0: both
  bool terminal = true;  ///< stop there; otherwise only report
};

enum class RunEnd { reached_end, event, step_limit, rounding_limit, not_finite };

/// What a run is ended by whose last step came to this.
[[nodiscard]] constexpr RunEnd run_end_of(StepEnd step) {
  switch (step) {
    case StepEnd::step_limit:
      return RunEnd::step_limit;
    case StepEnd::rounding_limit:
      return RunEnd::rounding_limit;
    case StepEnd::not_finite:
      return RunEnd::not_finite;
    case StepEnd::accepted:
      break;
  }
  return RunEnd::reached_end;
}

/// What that is called to the outside; a run that an event ended came as far as that.
[[nodiscard]] constexpr Outcome outcome_of(RunEnd end) {
  switch (end) {
    case RunEnd::step_limit:
      return Outcome::step_limit;
    case RunEnd::rounding_limit:
      return Outcome::tolerance_not_reachable;
    case RunEnd::not_finite:
      return Outcome::out_of_domain;
    case RunEnd::reached_end:
    case RunEnd::event:
      break;
  }
  return Outcome::reached_end;
}

template <class System>
struct RunResult {
  RunEnd end = RunEnd::reached_end;
  int event = -1;                                     ///< which g, if end == event
  double event_rate = 0.0;                            ///< dg/dt of that event along the motion
  double t_s = 0.0;                                   ///< where the run stopped
  State<typename System::Scalar, System::kStates> y;  ///< there, on the dense output
};

template <class System>
inline constexpr bool kHasEvents = requires {
  System::kEvents;
};

/// Looks for sign changes of the event functions within one step.
template <class System>
class EventScan {
 public:
  static constexpr int kEvents = System::kEvents;
  static constexpr int kN = System::kStates;
  /// Parts a step is looked at in; an extremum among them is checked with parabolas.
  static constexpr int kParts = 4;

  struct Crossing {
    int event = -1;
    double u = 0.0;  ///< fraction of the step
    double rate = 0.0;
  };

  EventScan(const System& system, const EventRule* rules) : system_(value_system(system)) {
    for (int i = 0; i < kEvents; ++i) rules_[i] = rules != nullptr ? rules[i] : EventRule{};
  }

  /// `fired`: the event this arc starts on, whose own zero at the start does not count (-1: none).
  void start(int fired) {
    fired_ = fired;
    fresh_ = true;
  }

  /// The first crossing after fraction `from` of the stepper's last step; its dense output is
  /// ready.
  template <class Stepper>
  [[nodiscard]] Crossing first_after(const Stepper& stepper, double from) {
    Crossing first;
    first.u = 2.0;
    State<double, kEvents> before = at(stepper, from);
    if (fresh_ && fired_ >= 0) {
      // The root found to rounding may lie on either side of zero: look a little later.
      before[fired_] = at(stepper, from + (1.0 - from) / 64.0)[fired_];
    }
    double u_before = from;
    State<double, kEvents> older = before;
    double u_older = from;
    // A crossing is the first once its neighbours, too, have been looked at for dips before it.
    for (int part = 1; part <= kParts && first.u > u_older; ++part) {
      const double u = from + (1.0 - from) * part / kParts;
      const State<double, kEvents> after = at(stepper, u);
      // Of the extrema seen by several parabolas each is looked at by the nearest.
      const double lowest = part == 2 ? u_older : 0.5 * (u_older + u_before);
      const double highest = part == kParts ? u : 0.5 * (u_before + u);
      for (int i = 0; i < kEvents; ++i) {
        if (before[i] == 0.0) continue;  // starts on the surface: not a crossing
        consider(stepper, i, u_before, before[i], u, after[i], first);
        if (part > 1)
          graze(stepper, i, {u_older, older[i]}, {u_before, before[i]}, {u, after[i]}, lowest,
                highest, first);
      }
      older = before;
      u_older = u_before;
      before = after;
      u_before = u;
    }
    fresh_ = false;
    return first;
  }

 private:
  static auto value_system(const System& system) {
    if constexpr (requires { System::Scalar::kLanes; }) {
      return system.values();
    } else {
      return system;
    }
  }
  using ValueSystem = decltype(value_system(*static_cast<const System*>(nullptr)));

  template <class Stepper>
  [[nodiscard]] State<double, kEvents> at(const Stepper& stepper, double u) const {
    State<double, kN> y;
    for (int c = 0; c < kN; ++c) y[c] = stepper.dense_value(c, u);
    State<double, kEvents> g;
    system_.events(stepper.t_previous_s() + u * stepper.step_s(), y, g);
    return g;
  }
  [[nodiscard]] bool wanted(int i, double before, double after) const {
    const int direction = rules_[i].direction;
    if (before < 0.0 && after >= 0.0) return direction >= 0;
    if (before > 0.0 && after <= 0.0) return direction <= 0;
    return false;
  }
  template <class Stepper>
  void consider(const Stepper& stepper, int i, double u0, double g0, double u1, double g1,
                Crossing& first) const {
    if (!wanted(i, g0, g1)) return;
    const double u = root(stepper, i, u0, g0, u1, g1);
    if (u < first.u) first = {i, u, rate(stepper, i, u)};
  }
  /// The event's function at a fraction of the step.
  struct Look {
    double u, g;
  };
  /// Fraction at which the parabola through three looks is level, if it bends away from zero there;
  /// else beyond the step.
  [[nodiscard]] static double dip(const Look& a, const Look& b, const Look& c) {
    const double before = (b.g - a.g) / (b.u - a.u), after = (c.g - b.g) / (c.u - b.u);
    const double bend = (after - before) / (c.u - a.u);
    if (!(bend * b.g > 0.0)) return 2.0;
    return 0.5 * (a.u + b.u - before / bend);
  }

  /// Three values of one sign: looks where their parabola comes nearest to zero, between `lowest`
  /// and `highest`, and once more where that was close.
  template <class Stepper>
  void graze(const Stepper& stepper, int i, Look a, Look b, Look c, double lowest, double highest,
             Crossing& first) const {
    const double sign = b.g > 0.0 ? 1.0 : -1.0;
    if (sign * a.g <= 0.0 || sign * c.g <= 0.0) return;
    constexpr double kClose = 0.1;  // of the event's function beside it
    double u = dip(a, b, c);
    for (int look = 0; look < 2 && u >= lowest && u <= highest && u != b.u; ++look) {
      const Look at_dip{u, at(stepper, u)[i]};
      const Look left = u < b.u ? a : b, right = u < b.u ? b : c;
      if (sign * at_dip.g <= 0.0) {
        consider(stepper, i, left.u, left.g, u, at_dip.g, first);
        if (first.event != i) consider(stepper, i, u, at_dip.g, right.u, right.g, first);
        return;
      }
      const double beside = sign * left.g > sign * right.g ? sign * left.g : sign * right.g;
      if (sign * at_dip.g > kClose * beside) return;
      a = left;
      b = at_dip;
      c = right;
      u = dip(a, b, c);
    }
  }

  /// Bracketed root, to rounding of the fraction: the secant's point moved a little towards the
  /// middle, so that the bracket shrinks from both sides (the idea is the truncation of
  /// [OliveiraTakahashi2020]; their projection is left out), and in every fourth step the middle
  /// itself, which bounds the number of steps by four times that of bisection; at most 60.
  template <class Stepper>
  [[nodiscard]] double root(const Stepper& stepper, int i, double a, double ga, double b,
                            double gb) const {
    for (int iteration = 0; iteration < 60 && b - a > 4e-16 * b && gb != 0.0; ++iteration) {
      const double middle = 0.5 * (a + b);
      double u = a + (b - a) * ga / (ga - gb);
      const double nudge = 0.2 * (b - a) * (b - a);
      u += u < middle ? (nudge < middle - u ? nudge : 0.0) : (nudge < u - middle ? -nudge : 0.0);
      if (iteration % 4 == 3 || !(u > a && u < b)) u = middle;
      const double g = at(stepper, u)[i];
      if ((g > 0.0) == (ga > 0.0) && g != 0.0) {
        a = u;
        ga = g;
      } else {
        b = u;
        gb = g;
      }
    }
    return b;
  }
  /// dg/dt from four points of the dense output.
  template <class Stepper>
  [[nodiscard]] double rate(const Stepper& stepper, int i, double u) const {
    constexpr double kApart = 2e-3;
    const double near = at(stepper, u + kApart)[i] - at(stepper, u - kApart)[i];
    const double far = at(stepper, u + 2.0 * kApart)[i] - at(stepper, u - 2.0 * kApart)[i];
    return (8.0 * near - far) / (12.0 * kApart * stepper.step_s());
  }

  ValueSystem system_;
  EventRule rules_[kEvents];
  int fired_ = -1;
  bool fresh_ = true;
};

struct NoScan {};
template <class System>
[[nodiscard]] TROCHOID_INLINE auto make_scan(const System& system, const EventRule* rules) {
  if constexpr (kHasEvents<System>) {
    return EventScan<System>(system, rules);
  } else {
    return NoScan{};
  }
}

struct NoEventReport {
  TROCHOID_INLINE void operator()(int, double) const {}
};

/// Integrates from the stepper's time to t_end_s.
///
/// @param t_s, count  output times, ascending, none before the stepper's time.
/// @param sink        sink(stepper, first, last): output times [first, last) lie in the last step;
///                    stepper.dense() of `components` is ready.
/// @param components  bit mask of the components the sink reads.
/// @param rules       one per event of the system, nullptr: all terminal in both directions.
/// @param fired       the event this arc starts on, -1: none.
/// @param report      report(event, t_s) at each event that does not stop the run.
template <template <class> class Stepper, class System, class Sink, class Report = NoEventReport>
RunResult<System> integrate(Stepper<System>& stepper, double t_end_s, const double* t_s, int count,
                            Sink&& sink, unsigned components = ~0u,
                            const EventRule* rules = nullptr, int fired = -1,
                            Report&& report = {}) {
  RunResult<System> result;
  int next = 0;
  const auto hand_out = [&](double until) {
    int last = next;
    while (last < count && t_s[last] <= until) ++last;
    if (last == next) return;
    stepper.prepare_dense(components);
    sink(stepper, next, last);
    next = last;
  };
  const auto stop = [&](RunEnd end, double t) -> RunResult<System>& {
    result.end = end;
    result.t_s = t;
    return result;
  };
  hand_out(stepper.t_s());
  [[maybe_unused]] auto scan = make_scan(stepper.system(), rules);
  if constexpr (kHasEvents<System>) scan.start(fired);
  while (stepper.t_s() < t_end_s) {
    const StepEnd step = stepper.step(t_end_s);
    if (step != StepEnd::accepted) {
      result.y = stepper.y();
      return stop(run_end_of(step), stepper.t_s());
    }
    if constexpr (kHasEvents<System>) {
      stepper.prepare_dense();
      double from = 0.0;
      while (from < 1.0) {
        const auto crossing = scan.first_after(stepper, from);
        if (crossing.event < 0) break;
        const double t = stepper.t_previous_s() + crossing.u * stepper.step_s();
        if (rules == nullptr || rules[crossing.event].terminal) {
          hand_out(t);
          result.event = crossing.event;
          result.event_rate = crossing.rate;
          result.y = stepper.dense_state(crossing.u);
          return stop(RunEnd::event, t);
        }
        report(crossing.event, t);
        scan.start(crossing.event);
        from = crossing.u;
      }
    }
    hand_out(stepper.t_s());
  }
  result.y = stepper.y();
  return stop(RunEnd::reached_end, stepper.t_s());
}

/// How much later the event comes when the parameters change: value 0, derivatives
/// -dg/dp / (dg/dt). `g` is the event function at the event with its derivatives.
template <class S>
[[nodiscard]] TROCHOID_INLINE S event_delay(const S& g, double rate) {
  const S shift = g * (-1.0 / rate);
  return shift - value_of(shift);
}

/// State at an event with the derivatives that it has there: those at a fixed instant, and what the
/// event's delay adds.
template <class System, class S, int N>
[[nodiscard]] auto moved_to_event(const System& system, double t_s, const State<S, N>& y,
                                  const S& delay) {
  State<S, N> slope, moved = y;
  system.derivative(t_s, y, slope);
  for (int i = 0; i < N; ++i) moved[i] += slope[i] * delay;
  return moved;
}

/// State to start the next arc with: the derivatives cross the event by the saltation matrix
///   S+ = (dR/dy + (f+ - dR/dy f-) (grad g)^T / (grad g . f-)) S-,
/// written with duals: go to the moved event along the old motion, reset, and come back along the
/// new one. With S = double this is only the reset.
/// @param before, after  systems on either side.
/// @param reset          y+ = reset(y-), for instance an impact map; identity if none.
template <class Before, class After, class S, int N, class Reset>
[[nodiscard]] auto across_event(const Before& before, const After& after, double t_s,
                                const State<S, N>& y, const S& delay, Reset&& reset) {
  auto next = reset(moved_to_event(before, t_s, y, delay));
  auto next_slope = next;
  after.derivative(t_s, next, next_slope);
  constexpr int kAfter = After::kStates;
  for (int i = 0; i < kAfter; ++i) next[i] -= next_slope[i] * delay;
  return next;
}

}  // namespace TROCHOID_ISA
}  // namespace trochoid::model
