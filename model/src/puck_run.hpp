#pragma once
#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "trochoid/model/puck.hpp"
#include "trochoid/model/simulate.hpp"

namespace trochoid::model {

/// A puck's motion at given times, also after it has come to rest.
template <class S>
struct PuckPath {
  std::vector<State<S, 7>> rows;  ///< states at the times; the last component is not used
  double rest_s = INFINITY;       ///< when it came to rest
  Statistics statistics;
  StepEnd end = StepEnd::accepted;
};

/// The state of the last step at time t: position on the dense output in tau by Newton's method,
/// then the derivatives carried from the moved instant to t itself.
template <class S>
[[nodiscard]] State<S, 7> puck_at(const DormandPrince<Puck<S>>& stepper, double t_s) {
  using P = Puck<S>;
  double low = 0.0, high = 1.0, u = 0.5;
  for (int i = 0; i < 80 && high - low > 1e-16; ++i) {
    const double ahead = value_of(stepper.dense(P::t, u)) - t_s;
    (ahead > 0.0 ? high : low) = u;
    if (ahead == 0.0) break;
    const double rate = value_of(stepper.system().stretch(stepper.dense_state(u)));
    const double next = u - ahead / (rate * stepper.step_s());
    const bool inside = next > low && next < high;
    if (inside && std::abs(next - u) < 1e-16) break;
    u = inside ? next : 0.5 * (low + high);
  }
  State<S, 7> s = stepper.dense_state(u);
  const S late = t_s - s[P::t];
  const auto a = stepper.system().acceleration(s);
  const S w = s[P::q] * (1.0 / stepper.system().radius);
  const S rates[6] = {a.x, a.y, a.couple, s[P::vx], s[P::vy], w};
  for (int c = 0; c < 6; ++c) s[c] += rates[c] * late;
  return s;
}

/// Runs the puck over ascending times from 0.
/// @param max_steps  0: the usual limit.
template <class S>
[[nodiscard]] PuckPath<S> run_puck(const Puck<S>& puck, const State<S, 7>& start,
                                   std::span<const double> t_s, double tolerance,
                                   int max_steps = 0) {
  using P = Puck<S>;
  PuckPath<S> path;
  path.rows.reserve(t_s.size());
  const auto speed = [](const State<S, 7>& s) {
    return std::sqrt(std::pow(value_of(s[P::vx]), 2) + std::pow(value_of(s[P::vy]), 2) +
                     std::pow(value_of(s[P::q]), 2));
  };
  // At this fraction of its first speed the puck is within 1e-18 of its first kinetic energy of
  // rest; what is left of the path is the square of it.
  constexpr double kRest = 1e-9;
  const double rest_speed = kRest * speed(start);
  // On a floor too steep for its friction a puck that comes to rest turns back, which is no motion
  // of this law.
  const bool held =
      std::hypot(value_of(puck.rise_x), value_of(puck.rise_y)) <= value_of(puck.friction);
  if (speed(start) == 0.0) {
    if (held) path.rest_s = 0.0;
    if (!held) path.end = StepEnd::not_finite;
    const auto known = held ? t_s.end() : std::upper_bound(t_s.begin(), t_s.end(), 0.0);
    path.rows.assign(static_cast<std::size_t>(known - t_s.begin()), start);
    return path;
  }
  StepControl<7> control = uniform_control<7>(tolerance);
  for (const int c : {P::vx, P::vy, P::q}) control.atol[c] = tolerance * 10.0 * rest_speed;
  if (max_steps > 0) control.max_steps = max_steps;
  const double pace = value_of(puck.stretch(start));
  control.atol[P::t] = tolerance * pace;
  control.atol[P::x] = control.atol[P::y] = tolerance * pace * speed(start);
  DormandPrince<P> stepper(puck, control);
  stepper.start(0.0, start);
  const double end_s = t_s.empty() ? 0.0 : t_s.back();
  constexpr double kEndless = 1e6;  // in tau; rest is reached within about 40
  while (value_of(stepper.y()[P::t]) < end_s && speed(stepper.y()) > rest_speed) {
    path.end = stepper.step(kEndless);
    if (path.end != StepEnd::accepted) break;
    while (path.rows.size() < t_s.size() && t_s[path.rows.size()] <= value_of(stepper.y()[P::t])) {
      stepper.prepare_dense();
      path.rows.push_back(puck_at(stepper, t_s[path.rows.size()]));
    }
  }
  if (path.rows.empty() && !t_s.empty() && t_s.front() <= 0.0) path.rows.push_back(start);
  const bool rests = path.end == StepEnd::accepted && speed(stepper.y()) <= rest_speed;
  if (rests && !held) path.end = StepEnd::not_finite;
  if (rests && held) {
    State<S, 7> rest = stepper.y();
    path.rest_s = value_of(rest[P::t]);
    rest[P::vx] = rest[P::vy] = rest[P::q] = S(0.0);
    path.rows.resize(t_s.size(), rest);
  }
  const StepCounts& counts = stepper.counts();
  path.statistics = {counts.steps, counts.rejected, counts.evaluations};
  return path;
}

}  // namespace trochoid::model
