#pragma once
#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "trochoid/model/events.hpp"
#include "trochoid/model/outcome.hpp"
#include "trochoid/model/radau.hpp"
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
  /// A slip begins with what it comes to a little later, by a series (S21): a fraction of the
  /// steps, and a force a per cent beyond friction's in between.
  bool skips_onset = false;
  bool stiff = false;           ///< friction that sets in softly asks for implicit steps
  bool rolls_at_first = false;  ///< as PredictRequest::rolls_at_first
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
  int work = 0;  ///< steps, each implicit one, which takes so much longer, counted as three
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

/// Absolute tolerances of a sliding body's slip: stick lives at slips below the regularisation,
/// which have to be resolved whatever the tolerance.
template <int N>
void resolve_stick(double eps_v_m_s, StepControl<N>& control) {
  constexpr double kOfRegularisation = 1e-4;
  if (eps_v_m_s > 0.0)
    for (const int c : {Rim::un, Rim::ut})
      control.atol[c] = std::min(control.atol[c], kOfRegularisation * eps_v_m_s);
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

/// A start on or beyond an event's surface never crosses it.
/// @returns what such a start is, nothing of a proper one.
template <class System, class S, int N>
[[nodiscard]] std::optional<Outcome> outside_at_start(const System& system, double t_s,
                                                      const State<S, N>& y) {
  State<S, System::kEvents> g;
  system.events(t_s, y, g);
  const auto outside = [&g](int event) { return !(value_of(g[event]) > 0.0); };
  if (outside(System::flat)) return Outcome::flat;
  if constexpr (requires { System::inconsistent; }) {
    if (outside(System::inconsistent)) return Outcome::inconsistent_contact;
  }
  if (outside(System::lift_off)) return Outcome::lift_off;
  return std::nullopt;
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
      if (steps_left() <= 0) {
        finish(Outcome::step_limit);
        break;
      }
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

  void place_on_rim() {
    set_side(touching_side(value_of(end_.y[Rim::theta]), value_of(end_.y[Rim::w1])));
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
  void note(std::string_view name) { end_.events.push_back({end_.end_s, std::string(name)}); }

  /// Events that crowd together: contact chatters faster than anything the model describes. So does
  /// a body that settles on its wall, by ever smaller impacts on both rims.
  [[nodiscard]] bool chattering(double t_s) {
    constexpr int kMany = 50;
    constexpr double kShort = 1e-3;  // of the time in which the body falls by its size
    const double short_s = kShort * std::sqrt(roll_.body.R / roll_.body.g);
    if (static_cast<int>(switch_times_s_.size()) >= kMany &&
        t_s - switch_times_s_[switch_times_s_.size() - kMany] < short_s)
      return true;
    switch_times_s_.push_back(t_s);
    return false;
  }

  /// The limit on steps is one of the whole run, however many phases it has.
  [[nodiscard]] int steps_left() const {
    return options_.max_steps - end_.statistics.steps - end_.statistics.rejected;
  }
  template <int N>
  [[nodiscard]] StepControl<N> control(const RimBody& body) const {
    StepControl<N> control = rim_control<N>(body, options_);
    control.max_steps = steps_left();
    return control;
  }

  template <class Stepper, class Sink>
  auto phase(Stepper& stepper, Sink& sink, const EventRule* rules, double until_s) {
    const int offset = next_;
    const auto rest = t_s_.subspan(static_cast<std::size_t>(offset));
    auto result = integrate(
        stepper, until_s, rest.data(), static_cast<int>(rest.size()),
        [&](auto& s, int first, int last) {
          sink(s, offset + first, offset + last);
          next_ = offset + last;
        },
        options_.components & Stepper::kAll, rules);
    const StepCounts& counts = stepper.counts();
    end_.statistics.steps += counts.steps;
    end_.work += counts.steps * Stepper::kWork;
    end_.statistics.rejected += counts.rejected;
    end_.statistics.evaluations += counts.evaluations;
    end_.end_s = result.t_s;
    return result;
  }
  template <class Result>
  void stopped(const Result& result) {
    if (result.end != RunEnd::event) finish(outcome_of(result.end));
  }

  template <class Sink>
  void rolling_phase(Sink& sink) {
    static constexpr EventRule kRules[] = {{-1}, {-1}, {-1}, {-1}};
    const State<S, 8> y = rolling_part(end_.y);
    if (!starts_inside(roll_, y)) return;
    DormandPrince<Roll> stepper(roll_, control<8>(roll_.body));
    stepper.start(end_.end_s, y);
    const auto result = phase(stepper, sink, kRules, options_.end_s);
    end_.y = with_slip(result.y, S(0.0), S(0.0));
    if (result.end != RunEnd::event) return stopped(result);
    const S delay = delay_of(result);
    if (result.event != Roll::slip) return end_rolling(result, delay);
    note("slip");
    if constexpr (kCoulomb) start_slip(result.y, delay, sink);
  }
  template <class Result>
  [[nodiscard]] S delay_of(const Result& result) const {
    State<S, Roll::kEvents> g;
    roll_.events(result.t_s, result.y, g);
    return event_delay(g[result.event], result.event_rate);
  }
  template <class Result>
  void end_rolling(const Result& result, const S& delay) {
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
    }
  }

  template <class Sink>
  void sliding_phase(Sink& sink) {
    if (!starts_inside(slide_, end_.y)) return;
    StepControl<10> limits = control<10>(slide_.body);
    // Under the exact law the direction of a slow slip is drawn in at the rate mu g/u. A path that
    // keeps to it shows no error even where a step is too long for that; derivatives blow up there.
    limits.control_derivatives = exact();
    if constexpr (kCoulomb) {
      if (options_.stiff) {
        limits = Radau<Slide>::loosened(limits);
        resolve_stick(value_of(slide_.friction.eps_v), limits);
        return sliding_phase(Radau<Slide>(slide_, limits), sink);
      }
    }
    sliding_phase(DormandPrince<Slide>(slide_, limits), sink);
  }
  template <class Stepper, class Sink>
  void sliding_phase(Stepper stepper, Sink& sink) {
    static constexpr EventRule kRules[] = {{-1}, {-1}, {-1}, {-1}, {-1}};
    stepper.start(end_.end_s, end_.y);
    const auto result = phase(stepper, sink, kRules, options_.end_s);
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
  template <class System, int N>
  bool starts_inside(const System& system, const State<S, N>& y) {
    const std::optional<Outcome> outside = outside_at_start(system, end_.end_s, y);
    if (!outside) return true;
    note(name(*outside));
    finish(*outside);
    return false;
  }

  /// Slip begins against the friction that rolling would need, so the force does not jump (S14).
  template <class Sink>
  void start_slip(const State<S, 8>& y, const S& delay, Sink& sink) {
    if (chattering(end_.end_s)) return finish(Outcome::chattering);
    if (options_.skips_onset) {
      const Onset onset = onset_of(moved_to_event(roll_, end_.end_s, y, delay));
      if (onset.lasts_s > 0.0) return skip_onset(y, onset, delay, sink);
    }
    end_.y = across_event(roll_, slide_, end_.end_s, y, delay,
                          [&](const State<S, 8>& at) { return slipping(at); });
    end_.regime = Regime::sliding;
  }

  /// How a slip sets in: the rates of a body that slips differ from those of one that rolls on by
  /// by_time t + by_angle (angle of the friction), and that angle is turning t (S21).
  struct Onset {
    Horizontal<S> force;  ///< direction of the friction where it begins
    State<S, 10> by_time, by_angle;
    S turning, slip;  ///< [rad/s]; second derivative of the slip's size [m/s^3]
    S aside;          ///< of by_angle, across the force
    double lasts_s =
        0.0;  ///< how long the series holds to the threshold of sticking; 0: not at all
  };

  /// Rates of a body that slips less those of one that rolls on.
  [[nodiscard]] State<S, 10> set_free(const State<S, 8>& y, const State<S, 10>& slipping) const {
    State<S, 8> rolls;
    State<S, 10> slides;
    roll_.derivative(end_.end_s, y, rolls);
    slide_.derivative(end_.end_s, slipping, slides);
    for (int i = 0; i < 8; ++i) slides[i] -= rolls[i];
    return slides;
  }
  /// The same of one whose friction along `force` has only just begun not to hold it.
  [[nodiscard]] State<S, 10> set_free(const State<S, 8>& y, const Horizontal<S>& force) const {
    const double size = -slide_.stick_speed_m_s;  // only its direction counts
    return set_free(y, with_slip<S>(y, force.along_n * size, force.along_mh * size));
  }

  template <int N>
  [[nodiscard]] static State<S, N> moved(State<S, N> y, const State<S, N>& slope, const S& by) {
    for (int i = 0; i < N; ++i) y[i] += slope[i] * by;
    return y;
  }
  [[nodiscard]] static State<S, 10> slope_between(const State<S, 10>& a, const State<S, 10>& b,
                                                  double apart) {
    State<S, 10> slope;
    for (int i = 0; i < 10; ++i) slope[i] = (b[i] - a[i]) * (1.0 / apart);
    return slope;
  }
  [[nodiscard]] static Horizontal<S> turned_by(const Horizontal<S>& a, const S& angle) {
    const S c = cos(angle), s = sin(angle);
    return {a.along_n * c - a.along_mh * s, a.along_n * s + a.along_mh * c};
  }
  /// Of a slip's rates, that across the force.
  [[nodiscard]] static S across(const Horizontal<S>& force, const State<S, 10>& rates) {
    return force.along_n * rates[Rim::ut] - force.along_mh * rates[Rim::un];
  }

  /// @param y  where rolling ends.
  [[nodiscard]] Onset onset_of(const State<S, 8>& y) const {
    const double short_s = 1e-3 * std::sqrt(roll_.body.R / roll_.body.g);
    constexpr double kSmall_rad = 1e-3;
    const auto q = roll_.motion(y);
    const auto needed = roll_.contact_force(q, roll_.acceleration(q));
    const S size = sqrt(needed.along_n * needed.along_n + needed.along_mh * needed.along_mh);
    Onset onset;
    onset.force = {needed.along_n / size, needed.along_mh / size};
    State<S, 8> slope;
    roll_.derivative(end_.end_s, y, slope);
    onset.by_time =
        slope_between(set_free(moved<8>(y, slope, S(-short_s)), onset.force),
                      set_free(moved<8>(y, slope, S(short_s)), onset.force), 2.0 * short_s);
    onset.by_angle =
        slope_between(set_free(y, turned_by(onset.force, S(-kSmall_rad))),
                      set_free(y, turned_by(onset.force, S(kSmall_rad))), 2.0 * kSmall_rad);
    // The slip grows against the friction, so that nothing is left across it.
    onset.aside = across(onset.force, onset.by_angle);
    onset.turning = -across(onset.force, onset.by_time) / onset.aside;
    const auto along = [&](const State<S, 10>& rates) {
      return onset.force.along_n * rates[Rim::un] + onset.force.along_mh * rates[Rim::ut];
    };
    onset.slip = -along(onset.by_time) - onset.turning * along(onset.by_angle);
    onset.lasts_s = lasting_s(onset, y, slope);
    return onset;
  }

  /// As long as the series, which errs by the square of its share of a turn, does so by no more
  /// than the threshold of sticking, and its second order remains a correction: short slips soon
  /// end.
  [[nodiscard]] double lasting_s(const Onset& onset, const State<S, 8>& y,
                                 const State<S, 8>& slope) const {
    const double slip = value_of(onset.slip), stick = slide_.stick_speed_m_s;
    if (!(slip > 0.0)) return 0.0;
    const double turning = std::sqrt(roll_.body.g / roll_.body.R) +
                           std::abs(value_of(onset.turning)) + std::abs(value_of(slope[Rim::phi])) +
                           std::abs(value_of(y[Rim::w1])) + std::abs(value_of(y[Rim::w3]));
    constexpr double kAbove = 4.0, kCorrection = 0.2;
    for (double lasts_s = std::pow(0.5 * stick / (slip * turning * turning), 0.25);
         0.5 * slip * lasts_s * lasts_s > kAbove * stick; lasts_s *= 0.5) {
      if (end_.end_s + lasts_s >= options_.end_s) continue;
      State<S, 8> halfway;
      roll_.derivative(end_.end_s, moved<8>(y, slope, S(0.5 * lasts_s)), halfway);
      const double grown =
          slip_of(slipping_since(moved<8>(y, halfway, S(lasts_s)), onset, S(lasts_s)));
      if (std::abs(grown / (0.5 * slip * lasts_s * lasts_s) - 1.0) < kCorrection) return lasts_s;
    }
    return 0.0;
  }

  /// Rolls on, whatever that asks of the floor, while the slip sets in, and adds what that has
  /// made. The instant at which it began has derivatives, that at which it is there has none.
  template <class Sink>
  void skip_onset(const State<S, 8>& y, const Onset& onset, const S& delay, Sink& sink) {
    static constexpr EventRule kRules[] = {{-1}, {-1}, {-1}, {-1}};
    Roll held = roll_;
    held.friction = S(0.0);
    DormandPrince<Roll> stepper(held, control<8>(roll_.body));
    stepper.start(end_.end_s, y);
    const auto result = phase(stepper, sink, kRules, end_.end_s + onset.lasts_s);
    end_.y = with_slip(result.y, S(0.0), S(0.0));
    if (result.end == RunEnd::event) return end_rolling(result, delay_of(result));
    if (result.end != RunEnd::reached_end) return stopped(result);
    end_.y = slipping_since(result.y, onset, onset.lasts_s - delay);
    end_.regime = Regime::sliding;
  }

  /// State of a body that began to slip so long ago, from that of one that has rolled on.
  [[nodiscard]] State<S, 10> slipping_since(const State<S, 8>& y, const Onset& onset,
                                            const S& since) const {
    const State<S, 10> first = moved<10>(onset.by_time, onset.by_angle, onset.turning);
    const S half_square = 0.5 * since * since, slip = onset.slip * half_square;
    const Horizontal<S> force = turned_by(onset.force, onset.turning * since);
    State<S, 10> guess = moved<10>(with_slip(y, S(0.0), S(0.0)), first, half_square);
    guess[Rim::un] = -slip * force.along_n;
    guess[Rim::ut] = -slip * force.along_mh;
    // At the next order the friction's angle is what lets the slip turn as fast as it does.
    State<S, 10> now = set_free(y, guess);
    const S aside = -across(force, now) - slip * onset.turning;
    now = moved<10>(now, onset.by_angle, aside / onset.aside);
    State<S, 10> grown = with_slip(y, S(0.0), S(0.0));
    grown = moved<10>(grown, first, half_square * (1.0 / 3.0));
    return moved<10>(grown, now, since * (1.0 / 3.0));
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
    if (chattering(end_.end_s)) return finish(Outcome::chattering);
    end_.y = across_event(slide_, slide_, end_.end_s, end_.y, delay,
                          [&](const State<S, 10>& at) { return slipping(rolling_part(at)); });
  }

  // Perfectly inelastic jump to the other rim (rolling.md, (12)).
  void rolling_rim_switch(const State<S, 8>& y, const S& delay) {
    note("rim_switch");
    if (!options_.impact_at_rim || chattering(end_.end_s)) return finish(Outcome::rim_switch);
    const RimBody& body = roll_.body;
    if (body.A + body.m * (body.R * body.R - body.h * body.h) <= 0.0)
      return finish(Outcome::rim_switch);  // line contact
    Roll after = roll_;
    after.body.side = -body.side;
    if constexpr (kCoulomb) {
      if (exact() && !bears_impact(y, after)) return jump_sliding(roll_, y, delay);
    }
    end_.y = with_slip(across_event(roll_, after, end_.end_s, y, delay,
                                    [&](const State<S, 8>& at) { return on_new_rim(at); }),
                       S(0.0), S(0.0));
    set_side(after.body.side);
    if constexpr (kCoulomb) {
      if (exact()) stick_or_slip();
    }
  }
  /// (12), to the rim that does not touch yet.
  [[nodiscard]] State<S, 8> on_new_rim(State<S, 8> s) const {
    const RimBody& body = roll_.body;
    const double m = body.m, A = body.A, C = body.C, R = body.R, h = -body.signed_h();
    const S w2 = s[Rim::w2], w3 = s[Rim::w3];
    const S v1 = -h * w2 - R * w3;
    const S b2 = A * w2 + m * h * v1, b3 = C * w3 - m * R * v1;
    const double inverse = 1.0 / (A * C + m * R * R * A + m * h * h * C);
    s[Rim::w1] *= (A + m * (R * R - h * h)) / (A + m * (R * R + h * h));
    s[Rim::w2] = ((C + m * R * R) * b2 + m * h * R * b3) * inverse;
    s[Rim::w3] = (m * h * R * b2 + (A + m * h * h) * b3) * inverse;
    return s;
  }
  /// Whether friction can give the impulse that lets the new rim rest at once: at most mu times the
  /// normal one. On edge e2 is vertical.
  [[nodiscard]] bool bears_impact(const State<S, 8>& y, const Roll& after) const {
    const auto before = roll_.motion(y), then = after.motion(on_new_rim(y));
    const double along_n = value_of(then.v1 - before.v1), along_k = value_of(then.v3 - before.v3);
    return std::hypot(along_n, along_k) <= value_of(roll_.friction) * value_of(then.v2 - before.v2);
  }

  void sliding_rim_switch(const State<S, 10>& y, const S& delay) {
    note("rim_switch");
    if (!options_.impact_at_rim || chattering(end_.end_s)) return finish(Outcome::rim_switch);
    jump_sliding(slide_, y, delay);
  }
  [[nodiscard]] static const State<S, 10>& with_its_slip(const State<S, 10>& y) { return y; }
  [[nodiscard]] static State<S, 10> with_its_slip(const State<S, 8>& y) {
    return with_slip(y, S(0.0), S(0.0));
  }
  /// To the other rim, by a vertical impulse only: where the contact slides, friction's share of
  /// the short impulse, mu times it, is left out (S15).
  template <class Before, int N>
  void jump_sliding(const Before& before, const State<S, N>& y, const S& delay) {
    const RimBody& body = slide_.body;
    const double A = body.A, mh2 = body.m * body.h * body.h, h = body.signed_h();
    if (A <= mh2) return finish(Outcome::rim_switch);
    Slide after = slide_;
    after.body.side = -body.side;
    end_.y = across_event(before, after, end_.end_s, y, delay, [&](const State<S, N>& at) {
      State<S, 10> s = with_its_slip(at);
      const S w1 = s[Rim::w1];
      s[Rim::w1] = w1 * ((A - mh2) / (A + mh2));
      s[Rim::un] += 2.0 * h * s[Rim::w2];
      s[Rim::ut] += body.R * (s[Rim::w1] - w1);
      return s;
    });
    end_.regime = Regime::sliding;
    set_side(after.body.side);
    if constexpr (kCoulomb) {
      if (exact() && slip_of(end_.y) <= slide_.stick_speed_m_s) stick_or_slip();
    }
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
