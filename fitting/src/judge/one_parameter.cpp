#include "judge/one_parameter.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "trochoid/data/angle.hpp"

namespace trochoid::fitting {
namespace {

// Its place among the free parameters; null: it is not one of them.
const FreeParameter* free_one(const Problem& problem, const char* name, int arc) {
  const int index = problem.predictor->index_of(name);
  const auto found =
      std::find_if(problem.free.begin(), problem.free.end(), [&](const FreeParameter& one) {
        return one.index == index && (one.arc < 0 || one.arc == arc);
      });
  return index < 0 || found == problem.free.end() ? nullptr : &*found;
}

// Leaves l sin(theta) and its rate as they are while l grows by a factor: u of tilt and tilting
// rate. Of small tilts a path shows hardly more than these.
void stand_up(const Problem& problem, double factor, Eigen::VectorXd& u) {
  for (int arc = 0; arc < static_cast<int>(problem.arcs.size()); ++arc) {
    const FreeParameter* const tilt = free_one(problem, "theta_rad", arc);
    if (tilt == nullptr) continue;
    double& tilt_u = u[tilt - problem.free.data()];
    const double theta = tilt->transform.value(tilt_u), sine = std::sin(theta) / factor;
    if (!(std::abs(sine) < 1.0)) continue;  // so short an l does not reach
    const double upright = std::cos(theta) > 0.0 ? std::asin(sine) : data::kPi - std::asin(sine);
    tilt_u = tilt->transform.inverse(upright);
    const FreeParameter* const rate = free_one(problem, "dtheta_rad_s", arc);
    if (rate == nullptr) continue;
    double& rate_u = u[rate - problem.free.data()];
    rate_u = rate->transform.inverse(rate->transform.value(rate_u) * std::cos(theta) /
                                     (factor * std::cos(upright)));
  }
}

}  // namespace

OneParameter::OneParameter(const Problem& problem, const Solution& solution, int index)
    : problem_(problem),
      solution_(solution),
      index_(index),
      length_of_top_(problem.free[index].index == problem.predictor->index_of("l_m")),
      held_(problem),
      place_{0.0, Eigen::VectorXd(solution.u.size() - 1)} {
  held_.free.erase(held_.free.begin() + index);
  place_.others << solution.u.head(index), solution.u.tail(solution.u.size() - 1 - index);
}

double OneParameter::rise(double offset, const SolveOptions& options) {
  const FreeParameter& parameter = problem_.free[index_];
  const double u = solution_.u[index_] + offset;
  for (std::size_t arc = 0; arc < held_.base.size(); ++arc)
    if (parameter.arc < 0 || parameter.arc == static_cast<int>(arc))
      held_.base[arc][parameter.index] = parameter.transform.value(u);
  const Solution best = minimise(held_, carried_to(offset), options);
  if (!best.usable) return std::numeric_limits<double>::infinity();
  place_ = {offset, best.u};
  return best.chi2 + outside(u) - solution_.chi2;
}

Eigen::VectorXd OneParameter::all() const {
  Eigen::VectorXd u(solution_.u.size());
  u << place_.others.head(index_), solution_.u[index_] + place_.offset,
      place_.others.tail(place_.others.size() - index_);
  return u;
}

// What the held parameter's own prior adds.
double OneParameter::outside(double u) const {
  const FreeParameter& parameter = problem_.free[index_];
  if (!parameter.prior) return 0.0;
  const double off = off_prior(*parameter.prior, parameter.transform.value(u), parameter.turns);
  return off * off;
}

Eigen::VectorXd OneParameter::carried_to(double offset) const {
  Eigen::VectorXd others = place_.others;
  if (!length_of_top_) return others;
  const double u = solution_.u[index_];
  const Transform& transform = problem_.free[index_].transform;
  stand_up(held_, transform.value(u + offset) / transform.value(u + place_.offset), others);
  return others;
}

}  // namespace trochoid::fitting
