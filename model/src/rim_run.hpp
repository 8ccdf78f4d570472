#pragma once
#include <algorithm>
#include <cmath>
#include <span>
#include <type_traits>
#include <vector>

#include "trochoid/model/events.hpp"
#include "trochoid/model/outcome.hpp"
#include "trochoid/model/simulate.hpp"
#include "trochoid/model/sliding.hpp"

/// Runs of rim bodies through all their regimes: rolling, sliding, the jump to the other rim.
namespace trochoid::model {

enum class Regime { rolling, sliding };

struct RimRunOptions {
  double tolerance = 1e-10;
  double end_s = 0.0;
  bool impact_at_rim = false;  ///< go on at theta = pi/2 with the impact map instead of ending
  unsigned components = ~0u;   ///< state components the sink reads
  int max_steps = 2000000;
  double stick_factor = 1.0;  ///< scales the threshold of sticking, to see its influence
};

/// How a run went; `y` is the state at `end_s`, of `regime` (rolling: the last two are 0). Where
/// the body fell flat its derivatives are those of the state it fell in, whenever that is.
template <class S>
struct RimRunEnd {
  Outcome outcome = Outcome::reached_end;
  double end_s = 0.0;
  State<S, 10> y{};
  Regime regime = Regime::rolling;
  double side = 1.0;
  std::vector<Event> events;
  Statistics statistics;
  double error_sum = 0.0;  ///< local errors in units of the tolerance
};

/// Tolerances by component: angles and rates by their own size, positions by the radius.
template <int N>
[[nodiscard]] StepControl<N> rim_control(const RimBody& body, const RimRunOptions& options) {
  StepControl<N> control;
  control.rtol = options.tolerance;
  control.max_steps = options.max_steps;
  const double speed = std::sqrt(body.g * body.R);
  for (int i = 0; i < N; ++i) {
    const bool angle = i <= Rim::psi, rate = i >= Rim::w1 && i <= Rim::w3;
    const double size = angle ? 1.0 : rate ? speed / body.R : i <= Rim::y ? body.R : 0.01 * speed;
    control.atol[i] = options.tolerance * size;
  }
  return control;
}

/// Slip speed at which the exact Coulomb law takes sticking for possible, and the slip a new
/// sliding phase starts with [m/s]. The path's error from it is of the same size times the time.
[[nodiscard]] inline double stick_speed_m_s(const RimBody& body) {
  constexpr double kRelative = 1e-7;
  return kRelative * std::sqrt(body.g * body.R);
}

/// State of a body that rolls, from one whose contact point rests.
template <class S>
[[nodiscard]] State<S, 8> rolling_part(const State<S, 10>& y) {
  State<S, 8> r;
  for (int i = 0; i < 8; ++i) r[i] = y[i];
  return r;
}
template <class S>
[[nodiscard]] State<S, 10> with_slip(const State<S, 8>& y, const S& un, const S& ut) {
  State<S, 10> r;
  for (int i = 0; i < 8; ++i) r[i] = y[i];
  r[Rim::un] = un;
  r[Rim::ut] = ut;
  return r;
}

/// The floor bears any friction: no sliding phase is compiled.
template <class S>
struct NoSlip {
  static constexpr bool kActive = false;
};

/// One run. `Friction` is the floor: NoSlip (rolls throughout), NoFriction (slides throughout) or
/// Coulomb (exact with eps_v = 0: rolling phases alternate with sliding ones).
template <class S, template <class> class Friction, template <class> class... Terms>
class RimRun {
 public:
  using Roll = Rolling<S, Terms...>;
  using Slide = Sliding<S, Friction, Terms...>;
  static constexpr bool kCoulomb = Friction<S>::kActive;
  static constexpr bool kSlides = !std::is_same_v<Friction<S>, NoSlip<S>>;
  static constexpr bool kRolls = kCoulomb || !kSlides;

  /// @param friction_limit  Coulomb coefficient that ends rolling phases, 0: never.
  RimRun(const RimBody& body, const Losses<S, Terms...>& losses, const Friction<S>& friction,
         const S& friction_limit, const RimRunOptions& options, std::span<const double> t_s)
      : roll_{body, losses, friction_limit},
        slide_{body, losses, friction, 0.0},
        options_(options),
        t_s_(t_s) {
    if constexpr (kCoulomb) {
      if (value_of(friction.eps_v) == 0.0)
        slide_.stick_speed_m_s = options.stick_factor * stick_speed_m_s(body);
    }
  }

  /// @param start  state at t_s = 0; its slip decides between rolling and sliding phases when
  ///               `regime` says sliding under the exact law.
  /// @param sink   sink(stepper, first, last): t_s[first, last) lie in the stepper's last step; its
  ///               system tells the regime.
  template <class Sink>
  RimRunEnd<S> run(State<S, 10> start, Regime regime, Sink&& sink) {
    end_ = {};
    end_.regime = regime;
    end_.y = start;
    place_on_rim();
    if constexpr (kCoulomb) {
      if (exact() && (regime == Regime::rolling || slip_of(end_.y) <= slide_.stick_speed_m_s))
        stick_or_slip();
    }
    while (end_.end_s < options_.end_s && going_on_) {
      if constexpr (kRolls) {
        if (end_.regime == Regime::rolling) {
          rolling_phase(sink);
          continue;
        }
      }
      if constexpr (kSlides) sliding_phase(sink);
    }
    end_.side = roll_.body.side;
    return end_;
  }

 private:
  [[nodiscard]] bool exact() const { return slide_.stick_speed_m_s > 0.0; }

  /// The rim that touches: by the tilt, and exactly on edge by the sense of falling.
  void place_on_rim() {
    const double c = std::cos(value_of(end_.y[Rim::theta]));
    const double w1 = value_of(end_.y[Rim::w1]);
    constexpr double kOnEdge = 1e-15;
    set_side(std::abs(c) < kOnEdge ? (w1 > 0.0 ? -1.0 : 1.0) : (c < 0.0 ? -1.0 : 1.0));
  }
  void set_side(double side) {
    roll_.body.side = side;
    slide_.body.side = side;
  }
  [[nodiscard]] static double slip_of(const State<S, 10>& y) {
    return std::hypot(value_of(y[Rim::un]), value_of(y[Rim::ut]));
  }

  void finish(Outcome outcome) {
    end_.outcome = outcome;
    going_on_ = false;
  }
  void note(const char* name) { end_.events.push_back({end_.end_s, name}); }

  /// Events that crowd together: contact chatters faster than anything the model describes.
  [[nodiscard]] bool chattering(double t_s) {
    constexpr int kMany = 50;
    constexpr double kShort_s = 1e-6;
    if (static_cast<int>(switch_times_s_.size()) >= kMany &&
        t_s - switch_times_s_[switch_times_s_.size() - kMany] < kShort_s)
      return true;
    switch_times_s_.push_back(t_s);
    return false;
  }

  /// The limit on steps is one of the whole run, however many phases it has.
  template <int N>
  [[nodiscard]] StepControl<N> control(const RimBody& body) const {
    StepControl<N> control = rim_control<N>(body, options_);
    const int taken = end_.statistics.steps + end_.statistics.rejected;
    control.max_steps = std::max(1, control.max_steps - taken);
    return control;
  }

  template <class Stepper, class Sink>
  auto phase(Stepper& stepper, Sink& sink, const EventRule* rules) {
    const int offset = next_;
    const auto rest = t_s_.subspan(static_cast<std::size_t>(offset));
    auto result = integrate(
        stepper, options_.end_s, rest.data(), static_cast<int>(rest.size()),
        [&](auto& s, int first, int last) {
          sink(s, offset + first, offset + last);
          next_ = offset + last;
        },
        options_.components & Stepper::kAll, rules);
    const StepCounts& counts = stepper.counts();
    end_.statistics.steps += counts.steps;
    end_.statistics.rejected += counts.rejected;
    end_.statistics.evaluations += counts.evaluations;
    end_.error_sum += counts.error_sum;
    end_.end_s = result.t_s;
    return result;
  }
  template <class Result>
  void stopped(const Result& result) {
    switch (result.end) {
      case RunEnd::reached_end:
        return finish(Outcome::reached_end);
      case RunEnd::step_limit:
        return finish(Outcome::step_limit);
      case RunEnd::rounding_limit:
        return finish(Outcome::tolerance_not_reachable);
      case RunEnd::not_finite:
        return finish(Outcome::out_of_domain);
      case RunEnd::event:
        break;
    }
  }

  template <class Sink>
  void rolling_phase(Sink& sink) {
    static constexpr EventRule kRules[] = {{-1}, {-1}, {-1}, {-1}};
    const State<S, 8> y = rolling_part(end_.y);
    if (!starts_inside(roll_, y)) return;
    DormandPrince<Roll> stepper(roll_, control<8>(roll_.body));
    stepper.start(end_.end_s, y);
    const auto result = phase(stepper, sink, kRules);
    end_.y = with_slip(result.y, S(0.0), S(0.0));
    if (result.end != RunEnd::event) return stopped(result);
    State<S, Roll::kEvents> g;
    roll_.events(result.t_s, result.y, g);
    const S delay = event_delay(g[result.event], result.event_rate);
    switch (result.event) {
      case Roll::flat:
        note("flat");
        end_.y = with_slip(moved_to_event(roll_, result.t_s, result.y, delay), S(0.0), S(0.0));
        return finish(Outcome::flat);
      case Roll::lift_off:
        note("lift_off");
        return finish(Outcome::lift_off);
      case Roll::rim:
        return rolling_rim_switch(result.y, delay);
      case Roll::slip:
        note("slip");
        if constexpr (kCoulomb) start_slip(result.y, delay);
    }
  }

  template <class Sink>
  void sliding_phase(Sink& sink) {
    static constexpr EventRule kRules[] = {{-1}, {-1}, {-1}, {-1}, {-1}};
    if (!starts_inside(slide_, end_.y)) return;
    StepControl<10> limits = control<10>(slide_.body);
    // Under the exact law the direction of a slow slip is drawn in at the rate mu g/u. A path that
    // keeps to it shows no error even where a step is too long for that; derivatives blow up there.
    limits.control_derivatives = exact();
    DormandPrince<Slide> stepper(slide_, limits);
    stepper.start(end_.end_s, end_.y);
    const auto result = phase(stepper, sink, kRules);
    end_.y = result.y;
    if (result.end != RunEnd::event) return stopped(result);
    State<S, Slide::kEvents> g;
    slide_.events(result.t_s, result.y, g);
    const S delay = event_delay(g[result.event], result.event_rate);
    switch (result.event) {
      case Slide::flat:
        note("flat");
        end_.y = moved_to_event(slide_, result.t_s, result.y, delay);
        return finish(Outcome::flat);
      case Slide::lift_off:
        note("lift_off");
        return finish(Outcome::lift_off);
      case Slide::inconsistent:
        note("inconsistent_contact");
        return finish(Outcome::inconsistent_contact);
      case Slide::rim:
        return sliding_rim_switch(result.y, delay);
      case Slide::stick:
        if constexpr (kCoulomb) settle(delay);
    }
  }
  /// A start beyond an event's surface never crosses it: name it at once.
  template <class System, int N>
  bool starts_inside(const System& system, const State<S, N>& y) {
    State<S, System::kEvents> g;
    system.events(end_.end_s, y, g);
    const auto outside = [&](int event) { return !(value_of(g[event]) > 0.0); };
    if (outside(System::flat)) return note("flat"), finish(Outcome::flat), false;
    if constexpr (requires { System::inconsistent; }) {
      if (outside(System::inconsistent))
        return note("inconsistent_contact"), finish(Outcome::inconsistent_contact), false;
    }
    if (outside(System::lift_off)) return note("lift_off"), finish(Outcome::lift_off), false;
    return true;
  }

  /// Slip begins against the friction that rolling would need, so the force does not jump (S14).
  void start_slip(const State<S, 8>& y, const S& delay) {
    if (chattering(end_.end_s)) return finish(Outcome::tolerance_not_reachable);
    end_.y = across_event(roll_, slide_, end_.end_s, y, delay,
                          [&](const State<S, 8>& at) { return slipping(at); });
    end_.regime = Regime::sliding;
  }
  [[nodiscard]] State<S, 10> slipping(const State<S, 8>& y) const {
    const auto q = roll_.motion(y);
    const auto force = roll_.contact_force(q, roll_.acceleration(q));
    const S size = sqrt(force.along_n * force.along_n + force.along_mh * force.along_mh);
    // Above the threshold of sticking, so that the new phase does not end where it begins.
    const S scale = (-2.0 * slide_.stick_speed_m_s) / size;
    return with_slip<S>(y, scale * force.along_n, scale * force.along_mh);
  }

  /// Whether the floor can hold a body whose contact point rests at y.
  [[nodiscard]] bool holds(const State<S, 8>& y) const {
    State<S, Roll::kEvents> g;
    roll_.events(end_.end_s, y, g);
    return value_of(g[Roll::slip]) > 0.0;
  }
  /// Regime of a body whose contact point rests, at the start or after an impact.
  void stick_or_slip() {
    const State<S, 8> y = rolling_part(end_.y);
    const bool sticks = holds(y);
    end_.regime = sticks ? Regime::rolling : Regime::sliding;
    end_.y = sticks ? with_slip(y, S(0.0), S(0.0)) : slipping(y);
  }

  /// The slip has come to rest: stick if the floor can hold the body, else slip the other way.
  void settle(const S& delay) {
    if (holds(rolling_part(end_.y))) {
      note("stick");
      end_.regime = Regime::rolling;
      end_.y = with_slip(across_event(slide_, roll_, end_.end_s, end_.y, delay,
                                      [](const State<S, 10>& at) { return rolling_part(at); }),
                         S(0.0), S(0.0));
      return;
    }
    if (chattering(end_.end_s)) return finish(Outcome::tolerance_not_reachable);
    end_.y = across_event(slide_, slide_, end_.end_s, end_.y, delay,
                          [&](const State<S, 10>& at) { return slipping(rolling_part(at)); });
  }

  // Perfectly inelastic jump to the other rim (rolling.md, (12)).
  void rolling_rim_switch(const State<S, 8>& y, const S& delay) {
    note("rim_switch");
    if (!options_.impact_at_rim || chattering(end_.end_s)) return finish(Outcome::rim_switch);
    const RimBody& body = roll_.body;
    const double m = body.m, A = body.A, C = body.C, R = body.R, h = -body.signed_h();
    if (A + m * (R * R - h * h) <= 0.0) return finish(Outcome::rim_switch);  // line contact
    Roll after = roll_;
    after.body.side = -body.side;
    end_.y = with_slip(
        across_event(roll_, after, end_.end_s, y, delay,
                     [&](State<S, 8> s) {
                       const S w1 = s[Rim::w1], w2 = s[Rim::w2], w3 = s[Rim::w3];
                       const S v1 = -h * w2 - R * w3;
                       const S b2 = A * w2 + m * h * v1, b3 = C * w3 - m * R * v1;
                       const double inverse = 1.0 / (A * C + m * R * R * A + m * h * h * C);
                       s[Rim::w1] = w1 * ((A + m * (R * R - h * h)) / (A + m * (R * R + h * h)));
                       s[Rim::w2] = ((C + m * R * R) * b2 + m * h * R * b3) * inverse;
                       s[Rim::w3] = (m * h * R * b2 + (A + m * h * h) * b3) * inverse;
                       return s;
                     }),
        S(0.0), S(0.0));
    set_side(after.body.side);
    if constexpr (kCoulomb) {
      if (exact()) stick_or_slip();
    }
  }

  /// The same with a vertical impulse only: while the contact slides, friction's share of the short
  /// impulse, mu times it, is left out (S15).
  void sliding_rim_switch(const State<S, 10>& y, const S& delay) {
    note("rim_switch");
    if (!options_.impact_at_rim || chattering(end_.end_s)) return finish(Outcome::rim_switch);
    const RimBody& body = slide_.body;
    const double A = body.A, mh2 = body.m * body.h * body.h, h = body.signed_h();
    if (A <= mh2) return finish(Outcome::rim_switch);
    Slide after = slide_;
    after.body.side = -body.side;
    end_.y = across_event(slide_, after, end_.end_s, y, delay, [&](State<S, 10> s) {
      const S before = s[Rim::w1];
      s[Rim::w1] = before * ((A - mh2) / (A + mh2));
      s[Rim::un] += 2.0 * h * s[Rim::w2];
      s[Rim::ut] += body.R * (s[Rim::w1] - before);
      return s;
    });
    set_side(after.body.side);
  }

  Roll roll_;
  Slide slide_;
  RimRunOptions options_;
  std::span<const double> t_s_;
  RimRunEnd<S> end_;
  std::vector<double> switch_times_s_;
  int next_ = 0;
  bool going_on_ = true;
};

}  // namespace trochoid::model
