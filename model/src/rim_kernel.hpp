#pragma once
#include <span>
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
  S friction;
};

/// What is the same in every call of one scene.
struct RimModel {
  RimBody body;
  data::ModelSettings terms;
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

/// State from the input; the slip from the velocity of the centre (S1).
template <class S>
[[nodiscard]] State<S, 10> rim_state(const RimBody& given, const RimInput<S>& in) {
  RimBody body = given;
  body.side = std::cos(value_of(in.theta)) < 0.0 ? -1.0 : 1.0;
  const auto v = node_from_world(World<S>{in.vx, in.vy}, in.phi);
  const S un = v.along_n + body.R * in.w3 - body.signed_h() * in.w2;
  const S ut = v.along_mh + tilt(body, in.theta).z * in.w1;
  return {in.phi, in.theta, in.psi, in.w1, in.w2, in.w3, in.x, in.y, un, ut};
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
  path.end = run.run(rim_state(model.body, input), regime, [&](auto& stepper, int first, int last) {
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
