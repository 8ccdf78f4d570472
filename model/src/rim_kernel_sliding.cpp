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

template <class S>
RimPath<S> run_sliding(const RimModel& model, const RimInput<S>& input,
                       const RimRunOptions& options, std::span<const double> t_s) {
  const double eps_v = model.terms.slip_regularisation_m_s.value_or(0.0);
  // Beyond this BDF with sensitivities is the faster one (trochoid study solvers).
  constexpr double kManySteps = 1e4;
  if (!options.impact_at_rim &&
      explicit_steps(model, value_of(input.friction), options.end_s) > kManySteps)
    return run_stiff(model, input, options, t_s);
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
