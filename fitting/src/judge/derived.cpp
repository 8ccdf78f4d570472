#include "judge/derived.hpp"

#include <fmt/format.h>

#include <cmath>
#include <functional>
#include <utility>

#include "trochoid/model/inertia.hpp"

namespace trochoid::fitting {
namespace {

// A quantity with a standard deviation that is independent of the fit.
struct Given {
  bool known = false;
  double value = 0.0, sigma = 0.0;
};

Given given(const data::Scene& scene, const std::string& name, std::optional<double> from_body) {
  const auto prior = scene.fit.prior.find(name);
  if (prior != scene.fit.prior.end()) return {true, prior->second.value, prior->second.sigma};
  if (from_body) return {true, *from_body, 0.0};
  return {};
}

// Error propagation through f(fit values, givens) by central differences: both covariance of the
// fit and the givens' own sigmas.
class Propagation {
 public:
  Propagation(const Problem& problem, const Eigen::VectorXd& u, const Eigen::MatrixXd& covariance)
      : problem_(problem), covariance_(covariance), values_(problem.values(0, u)) {}

  using Function = std::function<double(const Eigen::VectorXd& values, const std::vector<double>&)>;

  [[nodiscard]] Given operator()(const Function& f, const std::vector<Given>& givens) const {
    std::vector<double> g;
    for (const Given& one : givens) g.push_back(one.value);
    Given result{true, f(values_, g), 0.0};
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(covariance_.rows());
    for (int i = 0; i < gradient.size(); ++i) {
      if (problem_.free[i].arc > 0) continue;
      const double sigma = std::sqrt(covariance_(i, i));
      if (!(sigma > 0.0) || !std::isfinite(sigma)) continue;
      Eigen::VectorXd shifted = values_;
      // Within what a straight line says, and of sharp data well above rounding.
      const double step = std::max(1e-4 * sigma, 1e-6 * std::abs(values_[problem_.free[i].index]));
      shifted[problem_.free[i].index] += step;
      const double up = f(shifted, g);
      shifted[problem_.free[i].index] -= 2.0 * step;
      gradient[i] = (up - f(shifted, g)) / (2.0 * step);
    }
    double variance = gradient.dot(covariance_ * gradient);
    for (std::size_t i = 0; i < givens.size(); ++i) {
      if (!(givens[i].sigma > 0.0)) continue;
      std::vector<double> up = g, down = g;
      up[i] += 0.5 * givens[i].sigma;
      down[i] -= 0.5 * givens[i].sigma;
      const double change = f(values_, up) - f(values_, down);
      variance += change * change;
    }
    result.sigma = std::sqrt(variance);
    return result;
  }

 private:
  const Problem& problem_;
  const Eigen::MatrixXd& covariance_;
  Eigen::VectorXd values_;
};

void add(data::Fit& fit, const std::string& name, const std::string& unit, const Given& value,
         const std::string& note) {
  if (!std::isfinite(value.value) || fit.find(name) != nullptr) return;
  data::FitParameter parameter;
  parameter.name = name;
  parameter.value = value.value;
  parameter.sigma = value.sigma;
  parameter.unit = unit;
  parameter.status = data::ParameterStatus::derived;
  parameter.note = note;
  fit.parameters.push_back(parameter);
}

std::string words_of(const Given& given) {
  return given.sigma > 0.0 ? fmt::format("{:.5g} ± {:.2g}", given.value, given.sigma)
                           : fmt::format("{:.5g}", given.value);
}

/// Whether two measurements of one quantity do, beyond what was rounded where it was written down;
/// says so.
bool contradict(const Given& one, const Given& other, const std::string& what, data::Fit& fit) {
  constexpr double kSigmas = 4.0, kRounded = 0.05;
  const double apart = std::abs(one.value - other.value);
  if (apart <= kSigmas * std::hypot(one.sigma, other.sigma) ||
      apart <= kRounded * std::abs(other.value))
    return false;
  fit.warnings.push_back(
      fmt::format("{} contradict each other: {} and {}", what, words_of(one), words_of(other)));
  return true;
}

/// Two independent measurements of one quantity; the second may be missing.
Given combined(const Given& one, const Given& other) {
  if (!other.known) return one;
  const double of_one = 1.0 / (one.sigma * one.sigma), of_other = 1.0 / (other.sigma * other.sigma);
  if (!std::isfinite(of_one) || !std::isfinite(of_other)) return of_one > of_other ? one : other;
  return {true, (of_one * one.value + of_other * other.value) / (of_one + of_other),
          1.0 / std::sqrt(of_one + of_other)};
}

bool is_free(const Problem& problem, const char* name) {
  const int index = problem.predictor->index_of(name);
  for (const FreeParameter& parameter : problem.free)
    if (parameter.index == index) return true;
  return false;
}

}  // namespace

void add_derived_top(const Problem& problem, const Eigen::VectorXd& u,
                     const Eigen::MatrixXd& covariance, const data::Scene& scene, data::Fit& fit) {
  const Propagation propagate(problem, u, covariance);
  const int a = problem.predictor->index_of("a_1_s2"), b = problem.predictor->index_of("b_1_s");
  const int l = problem.predictor->index_of("l_m");
  const int omega = problem.predictor->index_of("omega_s_rad_s");
  const data::Body body = scene.body.value_or(data::Body{});
  const bool shaped = scene.body && body.kind != data::BodyKind::top && body.radius_m > 0.0;
  const Given I = given(scene, "I_kg_m2", body.I_kg_m2),
              Is = given(scene, "Is_kg_m2", body.Is_kg_m2);
  const Given mass = given(scene, "mass_kg", body.mass_kg);
  const Given spin = given(scene, "omega_s_rad_s", std::nullopt);
  const Given gravity = given(scene, "gravity_m_s2", scene.model.gravity_m_s2);
  // Of a top's moments: I is given about the pivot, of a shape about its centre, m l^2 less. With
  // a = m g l / I about the pivot either tells the mass. Of the givens I, Is, mass and gravity.
  using Values = Eigen::VectorXd;
  using Givens = std::vector<double>;
  const std::vector<Given> givens{I, Is, mass, gravity};
  const auto mass_of_I = [=](const Values& v, const Givens& g) {
    return v[a] * g[0] / (v[l] * (g[3] - (shaped ? v[a] * v[l] : 0.0)));
  };
  const auto I_at_pivot = [=, weighed = mass.known](const Values& v, const Givens& g) {
    return shaped ? g[0] + (weighed ? g[2] : mass_of_I(v, g)) * v[l] * v[l] : g[0];
  };
  const auto ratio = [=](const Values& v, const Givens& g) { return I_at_pivot(v, g) / g[1]; };

  if (omega >= 0 && is_free(problem, "omega_s_rad_s")) {
    const Given seen =
        propagate([=](const Values& v, const Givens&) { return v[omega] / v[b]; }, {});
    add(fit, "I_over_Is", "1", seen, "omega_s / b, the spin from the mark");
    if (I.known && Is.known)
      contradict(propagate(ratio, givens), seen, "the given I / Is and omega_s / b by the mark",
                 fit);
  } else if (I.known && Is.known) {
    add(fit, "I_over_Is", "1", propagate(ratio, givens), "from the given I and Is");
    const Given turned =
        propagate([=](const Values& v, const Givens& g) { return v[b] * ratio(v, g); }, givens);
    const bool both =
        spin.known && !contradict(turned, spin, "b I / Is and the spin as [fit] prior has it", fit);
    add(fit, "omega_s_rad_s", "rad/s", both ? combined(turned, spin) : turned,
        both ? "b I / Is with the given I and Is, and the spin as [fit] prior has it"
             : "b I / Is with the given I and Is");
  } else if (spin.known) {
    add(fit, "I_over_Is", "1",
        propagate(
            [=](const Eigen::VectorXd& v, const std::vector<double>& g) { return g[0] / v[b]; },
            {spin}),
        "omega_s / b, the spin as [fit] prior has it");
  } else if (shaped) {
    // Per unit mass; about the pivot I = A + m l^2 with the fitted l.
    data::Body unit = body;
    unit.mass_kg = 1.0;
    unit.I_kg_m2.reset();
    unit.Is_kg_m2.reset();
    const model::CentralInertia inertia = model::central_inertia(unit);
    const auto by_shape = [=](const Values& v) {
      return (inertia.transverse_kg_m2 + v[l] * v[l]) / inertia.axial_kg_m2;
    };
    add(fit, "I_over_Is", "1",
        propagate([=](const Values& v, const Givens&) { return by_shape(v); }, {}),
        "from the body's shape and the fitted l");
    add(fit, "omega_s_rad_s", "rad/s",
        propagate([=](const Values& v, const Givens&) { return v[b] * by_shape(v); }, {}),
        "b I / Is, I / Is from the body's shape and the fitted l");
  }
  if (I.known && mass.known)
    contradict(I,
               propagate(
                   [=](const Values& v, const Givens& g) {
                     return g[2] * v[l] * (g[3] / v[a] - (shaped ? v[l] : 0.0));
                   },
                   givens),
               "I_kg_m2 and what mass_kg and the fitted a and l make of it", fit);
  if (I.known && !mass.known)
    add(fit, "mass_kg", "kg", propagate(mass_of_I, givens),
        "from a and l with the given I and gravity");
}

void add_derived_velocity(const Problem& problem, const Eigen::VectorXd& u,
                          const Eigen::MatrixXd& covariance, data::Fit& fit) {
  if (!problem.rolls_at_first) return;
  std::vector<int> free;
  for (const FreeParameter& parameter : problem.free) free.push_back(parameter.index);
  const RollingVelocity v = rolling_velocity(*problem.predictor, problem.values(0, u), free);
  Eigen::MatrixXd known = covariance;
  for (Eigen::Index i = 0; i < known.rows(); ++i)
    if (!std::isfinite(known(i, i))) known.row(i).setZero(), known.col(i).setZero();
  const Eigen::Matrix2d variance = v.by * known * v.by.transpose();
  for (const auto& [name, axis] : {std::pair{"vx_m_s", 0}, {"vy_m_s", 1}})
    add(fit, name, "m/s", {true, v.m_s[axis], std::sqrt(variance(axis, axis))},
        "velocity of the centre; the body rolls at first, so it follows from the spin");
}

}  // namespace trochoid::fitting
