#include "rim_kernel.hpp"

namespace trochoid::model {
template <class S>
RimPath<S> run_smooth(const RimModel& model, const RimInput<S>& input, const RimRunOptions& options,
                      std::span<const double> t_s) {
  return with_few_terms(model.terms, model.sloped, [&](auto terms) {
    return rim_path<S, NoFriction>(model, input, NoFriction<S>{}, S(0.0), Regime::sliding, options,
                                   t_s, terms);
  });
}

double explicit_steps(const RimModel& model, const Coulomb<double>& friction, double duration_s) {
  if (friction.eps_v == 0.0) return 0.0;
  constexpr double kStability = 6.0;
  const RimBody& b = model.body;
  const double rate = friction.mu * b.m * b.g / friction.eps_v *
                      (1.0 / b.m + b.R * b.R / b.C + (b.h * b.h + b.R * b.R) / b.A);
  return rate * duration_s / kStability;
}

// Implicit steps follow the body's turns and the tolerance; explicit ones, of which stability takes
// about a quarter of the bound, the friction. Measured with derivatives on a coin (R = 12 mm) and a
// disc (37 mm). Where stability sets explicit steps, derivatives are worse than values besides:
// nothing in a path that keeps to a slow creep tells that they are about to run away.
bool asks_for_implicit_steps(const RimModel& model, double explicit_bound, double theta_rad,
                             double w2_rad_s, const RimRunOptions& options) {
  constexpr double kStepsPerTime = 80.0;  // of the fastest turn
  constexpr double kAtTolerance = 1e-7, kPower = 1.0 / 6.0;
  const double turning_rad_s = std::abs(w2_rad_s / std::sin(theta_rad));
  const double fastest_rad_s = std::max(std::sqrt(model.body.g / model.body.R), turning_rad_s);
  return explicit_bound > kStepsPerTime * options.end_s * fastest_rad_s *
                              std::pow(kAtTolerance / options.tolerance, kPower);
}

template <class S>
RimPath<S> run_sliding(const RimModel& model, const RimInput<S>& input, const RimRunOptions& given,
                       std::span<const double> t_s) {
  RimRunOptions options = given;
  Coulomb<S> friction{input.friction, input.eps_v};
  // A floor without friction never holds the body, which Coulomb's law does to one that does not
  // slip; set in softly its friction still has a derivative.
  if (value_of(friction.mu) == 0.0 && value_of(friction.eps_v) == 0.0)
    friction.eps_v = S(stick_speed_m_s(model.body));
  const double steps = explicit_steps(model, friction.values(), options.end_s);
  options.stiff =
      asks_for_implicit_steps(model, steps, value_of(input.theta), value_of(input.w2), options);
  // Stability asks for that many, whatever the motion.
  constexpr double kCountable = 1e9;
  if (!options.stiff)
    options.max_steps = std::max(options.max_steps, static_cast<int>(std::min(steps, kCountable)));
  const S limit = value_of(friction.eps_v) > 0.0 ? S(0.0) : friction.mu;
  return with_few_terms(model.terms, model.sloped, [&](auto terms) {
    return rim_path<S, Coulomb>(model, input, friction, limit, Regime::sliding, options, t_s,
                                terms);
  });
}

template RimPath<double> run_smooth(const RimModel&, const RimInput<double>&, const RimRunOptions&,
                                    std::span<const double>);
template RimPath<Dual8> run_smooth(const RimModel&, const RimInput<Dual8>&, const RimRunOptions&,
                                   std::span<const double>);
template RimPath<double> run_sliding(const RimModel&, const RimInput<double>&, const RimRunOptions&,
                                     std::span<const double>);
template RimPath<Dual8> run_sliding(const RimModel&, const RimInput<Dual8>&, const RimRunOptions&,
                                    std::span<const double>);

}  // namespace trochoid::model
