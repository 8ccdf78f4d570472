#include "rim_kernel.hpp"

namespace trochoid::model {

template <class S>
RimPath<S> run_rolling(const RimModel& model, const RimInput<S>& input,
                       const RimRunOptions& options, std::span<const double> t_s) {
  return with_terms(model.terms, model.sloped, [&](auto terms) {
    return rim_path<S, NoSlip>(model, input, NoSlip<S>{}, S(0.0), Regime::rolling, options, t_s,
                               terms);
  });
}

template RimPath<double> run_rolling(const RimModel&, const RimInput<double>&, const RimRunOptions&,
                                     std::span<const double>);
template RimPath<Dual8> run_rolling(const RimModel&, const RimInput<Dual8>&, const RimRunOptions&,
                                    std::span<const double>);

}  // namespace trochoid::model
