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

// Estimated steps (the bound counts about three times those taken) beyond which BDF is the faster
// one. Up to there explicit steps win at equal error, the more the finer the tolerance; and values
// with and without derivatives then agree to rounding, while BDF's differ by their errors, which
// stops a minimiser short of the minimum.
double many_steps(double tolerance) {
  constexpr double kManySteps = 1.5e5, kAtTolerance = 1e-8, kPower = 0.15;
  return kManySteps * std::pow(kAtTolerance / tolerance, kPower);
}

}  // namespace

template <class S>
RimPath<S> run_sliding(const RimModel& model, const RimInput<S>& input, const RimRunOptions& given,
                       std::span<const double> t_s) {
  RimRunOptions options = given;
  const double eps_v = model.terms.slip_regularisation_m_s.value_or(0.0);
  const double steps = explicit_steps(model, value_of(input.friction), options.end_s);
  if (!options.impact_at_rim && steps > many_steps(options.tolerance))
    return run_stiff(model, input, options, t_s);
  // Stability asks for that many, whatever the motion.
  options.max_steps = std::max(options.max_steps, static_cast<int>(steps));
  const S limit = eps_v > 0.0 ? S(0.0) : input.friction;
  return with_few_terms(model.terms, [&](auto terms) {
    return rim_path<S, Coulomb>(model, input, Coulomb<S>{input.friction, eps_v}, limit,
                                Regime::sliding, options, t_s, terms);
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
