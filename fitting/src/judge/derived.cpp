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

void tell_contradiction(const Given& one, const Given& other, const std::string& what,
                        data::Fit& fit) {
  constexpr double kContradicts = 4.0;
  const double apart = std::abs(one.value - other.value),
               sigma = std::hypot(one.sigma, other.sigma);
  if (apart > kContradicts * sigma)
    fit.warnings.push_back(
        fmt::format("{} contradict each other: {:.5g} ± {:.2g} and {:.5g} ± {:.2g}", what,
                    one.value, one.sigma, other.value, other.sigma));
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
  // A top's moments are given about the pivot, those of a body with a shape about its centre.
  const Given to_pivot = body.kind == data::BodyKind::top ? Given{true, 0.0, 0.0} : mass;

  if (omega >= 0 && is_free(problem, "omega_s_rad_s")) {
    add(fit, "I_over_Is", "1",
        propagate([=](const Eigen::VectorXd& v, const auto&) { return v[omega] / v[b]; }, {}),
        "omega_s / b, the spin from the mark");
  } else if (I.known && Is.known) {
    const auto ratio = [=](const Eigen::VectorXd& v, const std::vector<double>& g) {
      return (g[0] + g[2] * v[l] * v[l]) / g[1];
    };
    const std::vector<Given> givens{I, Is, to_pivot};
    add(fit, "I_over_Is", "1", propagate(ratio, givens), "from the given I and Is");
    const Given turned = propagate(
        [=](const Eigen::VectorXd& v, const std::vector<double>& g) { return v[b] * ratio(v, g); },
        givens);
    if (spin.known)
      tell_contradiction(turned, spin, "b I / Is and the spin as [fit] prior has it", fit);
    add(fit, "omega_s_rad_s", "rad/s", combined(turned, spin),
        spin.known ? "b I / Is with the given I and Is, and the spin as [fit] prior has it"
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
    const auto ratio = [=](const Eigen::VectorXd& v) {
      return (inertia.transverse_kg_m2 + v[l] * v[l]) / inertia.axial_kg_m2;
    };
    add(fit, "I_over_Is", "1",
        propagate([=](const Eigen::VectorXd& v, const auto&) { return ratio(v); }, {}),
        "from the body's shape and the fitted l");
    add(fit, "omega_s_rad_s", "rad/s",
        propagate([=](const Eigen::VectorXd& v, const auto&) { return v[b] * ratio(v); }, {}),
        "b I / Is, I / Is from the body's shape and the fitted l");
  }
  Given gravity = given(scene, "gravity_m_s2", scene.model.gravity_m_s2);
  // A shape's given moments are about its centre, and a says nothing of the pivot's alone.
  if (I.known && mass.known && body.kind == data::BodyKind::top)
    tell_contradiction(
        I,
        propagate([=](const Eigen::VectorXd& v,
                      const std::vector<double>& g) { return g[0] * g[1] * v[l] / v[a]; },
                  {mass, gravity}),
        "I_kg_m2 and m g l / a with mass_kg and the fitted a and l", fit);
  if (I.known && !mass.known)
    add(fit, "mass_kg", "kg",
        propagate([=](const Eigen::VectorXd& v,
                      const std::vector<double>& g) { return v[a] * g[0] / (g[1] * v[l]); },
                  {I, gravity}),
        "a I / (g l) with the given I and gravity");
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
