#pragma once
#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "rim_run.hpp"
#include "rim_setup.hpp"
#include "trochoid/data/scene.hpp"

/// The compiled models of a body with rim contact: one function per floor, for numbers and for
/// numbers with eight derivatives. Each picks the compiled list of loss terms.
namespace trochoid::model {

using Dual8 = Dual<8>;

/// What a run depends on. Where the body slides, vx and vy count; a rolling one has them from the
/// rest.
template <class S>
struct RimInput {
  S theta, phi, psi, w1, w2, w3, x, y, vx, vy;
  LossValues<S> losses;
  S friction, eps_v;  ///< of a floor that grips; eps_v as in Coulomb
};

/// What is the same in every call of one scene.
struct RimModel {
  RimBody body;
  data::ModelSettings terms;
  bool sloped = false;
};

/// Components of the state at the output times that were reached.
template <class S>
struct RimPath {
  std::vector<State<S, 5>> rows;  ///< phi, theta, psi, x, y; those asked for
  RimRunEnd<S> end;
};

template <class S>
RimPath<S> run_rolling(const RimModel& model, const RimInput<S>& input,
                       const RimRunOptions& options, std::span<const double> t_s);
template <class S>
RimPath<S> run_smooth(const RimModel& model, const RimInput<S>& input, const RimRunOptions& options,
                      std::span<const double> t_s);
template <class S>
RimPath<S> run_sliding(const RimModel& model, const RimInput<S>& input,
                       const RimRunOptions& options, std::span<const double> t_s);

/// Steps an explicit method would need for the regularised law over `duration_s`: its stability
/// limit times the fastest rate, at most (S19) while N = m g; 0 for the exact law.
[[nodiscard]] double explicit_steps(const RimModel& model, const Coulomb<double>& friction,
                                    double duration_s);

/// Whether implicit steps are faster than so many explicit ones, from such a tilt and w2.
[[nodiscard]] bool asks_for_implicit_steps(const RimModel& model, double explicit_bound,
                                           double theta_rad, double w2_rad_s,
                                           const RimRunOptions& options);

/// Body and losses of a system over S from an input over From.
template <class System, class From>
void place(const RimModel& model, const RimInput<From>& input, System& system) {
  using S = typename System::Scalar;
  system.body = model.body;
  system.body.side = touching_side(value_of(input.theta), value_of(input.w1));
  LossValues<S> losses{};
  const auto over = [](const From& value) {
    if constexpr (std::is_same_v<S, From>)
      return value;
    else
      return S(value_of(value));
  };
  for (int i = 0; i < kLosses; ++i) losses.value[i] = over(input.losses.value[i]);
  losses.air_ratio = input.losses.air_ratio;
  losses.quadratic_ratio = input.losses.quadratic_ratio;
  losses.eps_w = input.losses.eps_w;
  losses.rise = {over(input.losses.rise.x), over(input.losses.rise.y)};
  system.losses = make_losses<typename System::LossList>(losses);
}

/// State from the input; the slip from the velocity of the centre (S1).
template <class S>
[[nodiscard]] State<S, 10> rim_state(const RimBody& given, const RimInput<S>& in) {
  RimBody body = given;
  body.side = touching_side(value_of(in.theta), value_of(in.w1));
  const auto v = node_from_world(World<S>{in.vx, in.vy}, in.phi);
  const S un = v.along_n + body.R * in.w3 - body.signed_h() * in.w2;
  const S ut = v.along_mh + tilt(body, in.theta).z * in.w1;
  return {in.phi, in.theta, in.psi, in.w1, in.w2, in.w3, in.x, in.y, un, ut};
}

/// The same of a body that rolls: its contact point rests, or creeps under friction that sets in
/// softly (S22).
template <class Roll, class S>
[[nodiscard]] State<S, 10> rolling_state(const RimModel& model, RimInput<S> input) {
  State<S, 10> y = rim_state(model.body, input);
  y[Rim::un] = y[Rim::ut] = S(0.0);
  if (!(value_of(input.eps_v) > 0.0)) return y;
  Roll roll;
  place(model, input, roll);
  const auto q = roll.motion(rolling_part(y));
  const ContactForce<S> needed = roll.contact_force(q, roll.acceleration(q));
  const S most = input.friction * needed.normal;
  const S spare = most * most - needed.along_n * needed.along_n - needed.along_mh * needed.along_mh;
  constexpr double kLeastSpare = 0.01;  // beyond, nothing holds the body: it begins to slide
  const S least = kLeastSpare * most * most;
  if (!(value_of(most) > 0.0)) return y;
  const S creep = -input.eps_v / sqrt(value_of(spare) > value_of(least) ? spare : least);
  y[Rim::un] = creep * needed.along_n;
  y[Rim::ut] = creep * needed.along_mh;
  return y;
}

/// Runs one floor with one list of terms and keeps the path.
template <class S, template <class> class Friction, template <class> class... Terms>
[[nodiscard]] RimPath<S> rim_path(const RimModel& model, const RimInput<S>& input,
                                  const Friction<S>& friction, const S& friction_limit,
                                  Regime regime, const RimRunOptions& options,
                                  std::span<const double> t_s, TermList<Terms...>) {
  constexpr int kComponents[] = {Rim::phi, Rim::theta, Rim::psi, Rim::x, Rim::y};
  RimPath<S> path;
  path.rows.resize(t_s.size());
  RimRun<S, Friction, Terms...> run(model.body, make_losses<Losses<S, Terms...>>(input.losses),
                                    friction, friction_limit, options, t_s);
  int reached = 0;
  State<S, 10> start = rim_state(model.body, input);
  if constexpr (decltype(run)::kCoulomb)
    if (options.rolls_at_first) start = rolling_state<Rolling<S, Terms...>>(model, input);
  path.end = run.run(start, regime, [&](auto& stepper, int first, int last) {
    for (int n = first; n < last; ++n) {
      const double u = stepper.fraction(t_s[static_cast<std::size_t>(n)]);
      for (int c = 0; c < 5; ++c) {
        if ((options.components >> kComponents[c] & 1u) != 0)
          path.rows[static_cast<std::size_t>(n)][c] = stepper.dense(kComponents[c], u);
      }
    }
    reached = last;
  });
  path.rows.resize(static_cast<std::size_t>(reached));
  return path;
}

}  // namespace trochoid::model
