#include "rim_kernel.hpp"

namespace trochoid::model {
template <class S>
RimPath<S> run_smooth(const RimModel& model, const RimInput<S>& input, const RimRunOptions& options,
                      std::span<const double> t_s) {
  return with_few_terms(model.terms, [&](auto terms) {
    return rim_path<S, NoFriction>(model, input, NoFriction<S>{}, S(0.0), Regime::sliding, options,
                                   t_s, terms);
  });
}

namespace {

// Whether BDF is the faster one at equal error. Its steps follow the body's turns, some thousand
// for each at these errors and each several times as dear with derivatives; explicit ones, of which
// stability takes about a third of the bound, follow the friction. Both grow with the duration.
// Measured with derivatives on a coin (R = 12 mm) and a disc (37 mm). What BDF does not reach is
// left to explicit steps as long as these are not beyond all measure.
bool too_stiff(const RimModel& model, double bound, const RimRunOptions& options) {
  constexpr double kStepsPerTime = 6e3;  // of sqrt(R/g)
  constexpr double kAtTolerance = 1e-5, kPower = 0.13;
  constexpr double kReached = 1e-8, kBeyondMeasure = 2e6;
  if (options.tolerance < kReached) return bound > kBeyondMeasure;
  const double times = options.end_s * std::sqrt(model.body.g / model.body.R);
  return bound > kStepsPerTime * times * std::pow(kAtTolerance / options.tolerance, kPower);
}

}  // namespace

template <class S>
RimPath<S> run_sliding(const RimModel& model, const RimInput<S>& input, const RimRunOptions& given,
                       std::span<const double> t_s) {
  RimRunOptions options = given;
  const Coulomb<S> friction{input.friction, input.eps_v};
  const double steps = explicit_steps(model, friction.values(), options.end_s);
  if (!options.impact_at_rim && too_stiff(model, steps, options))
    return run_stiff(model, input, options, t_s);
  // Stability asks for that many, whatever the motion.
  options.max_steps = std::max(options.max_steps, static_cast<int>(steps));
  const S limit = value_of(friction.eps_v) > 0.0 ? S(0.0) : friction.mu;
  return with_few_terms(model.terms, [&](auto terms) {
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
