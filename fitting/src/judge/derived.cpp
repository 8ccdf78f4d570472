#include "judge/derived.hpp"

#include <fmt/format.h>

#include <algorithm>
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
  Propagation(const Problem& problem, const Eigen::VectorXd& u, const Eigen::MatrixXd& covariance,
              int arc)
      : problem_(problem), covariance_(covariance), arc_(arc), values_(problem.values(arc, u)) {}

  using Function = std::function<double(const Eigen::VectorXd& values, const std::vector<double>&)>;

  [[nodiscard]] Given operator()(const Function& f, const std::vector<Given>& givens) const {
    std::vector<double> g;
    for (const Given& one : givens) g.push_back(one.value);
    Given result{true, f(values_, g), 0.0};
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(covariance_.rows());
    for (int i = 0; i < gradient.size(); ++i) {
      if (problem_.free[i].arc >= 0 && problem_.free[i].arc != arc_) continue;
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
  int arc_;
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

// Whether a top has dimensions, from which moments follow.
bool has_shape(const data::Scene& scene) {
  return scene.body && scene.body->kind != data::BodyKind::top && scene.body->radius_m > 0.0;
}

// The first arc in which a parameter of its own is free; -1: none.
int arc_that_frees(const Problem& problem, const char* name) {
  const int index = problem.predictor->index_of(name);
  for (const FreeParameter& parameter : problem.free)
    if (parameter.index == index) return std::max(0, parameter.arc);
  return -1;
}

// What a top's a, b and l become with what else is known of it. Its moments are given about the
// pivot, those of a shape about its centre, m l^2 less.
class DerivedTop {
 public:
  DerivedTop(const Problem& problem, const Eigen::VectorXd& u, const Eigen::MatrixXd& covariance,
             const data::Scene& scene, data::Fit& fit)
      : seen_in_(arc_that_frees(problem, "omega_s_rad_s")),
        propagate_(problem, u, covariance, std::max(0, seen_in_)),
        fit_(fit),
        body_(scene.body.value_or(data::Body{})),
        shaped_(has_shape(scene)),
        a_(problem.predictor->index_of("a_1_s2")),
        b_(problem.predictor->index_of("b_1_s")),
        l_(problem.predictor->index_of("l_m")),
        omega_(problem.predictor->index_of("omega_s_rad_s")),
        moment_(given(scene, "I_kg_m2", body_.I_kg_m2)),
        axial_(given(scene, "Is_kg_m2", body_.Is_kg_m2)),
        mass_(given(scene, "mass_kg", body_.mass_kg)),
        gravity_(given(scene, "gravity_m_s2", scene.model.gravity_m_s2)),
        spin_(given(scene, "omega_s_rad_s", std::nullopt)),
        radius_(given(scene, "radius_m", body_.radius_m)),
        inner_radius_(given(scene, "inner_radius_m", body_.inner_radius_m)),
        thickness_(given(scene, "thickness_m", body_.thickness_m)) {}

  void add_ratio_and_spin() const {
    if (seen_in_ >= 0)
      by_mark();
    else if (moment_.known && axial_.known)
      by_moments();
    else if (spin_.known)
      by_spin();
    else if (shaped_)
      by_shape();
  }
  // With a = m g l / I about the pivot either of I and m tells the other.
  void add_mass() const {
    if (!moment_.known) return;
    if (mass_.known)
      contradict(moment_, of([=, this](const Values& v, const Givens& g) {
                   return g[kMass] * v[l_] * (g[kGravity] / v[a_] - (shaped_ ? v[l_] : 0.0));
                 }),
                 "I_kg_m2 and what mass_kg and the fitted a and l make of it", fit_);
    else
      add(fit_, "mass_kg", "kg",
          of([=, this](const Values& v, const Givens& g) { return mass_of_moment(v, g); }),
          "from a and l with the given I and gravity");
  }

 private:
  using Values = Eigen::VectorXd;
  using Givens = std::vector<double>;
  enum : std::size_t { kMoment, kAxial, kMass, kGravity, kSpin, kRadius, kInner, kThickness };

  [[nodiscard]] Given of(const Propagation::Function& f) const {
    return propagate_(
        f, {moment_, axial_, mass_, gravity_, spin_, radius_, inner_radius_, thickness_});
  }
  [[nodiscard]] double mass_of_moment(const Values& v, const Givens& g) const {
    return v[a_] * g[kMoment] / (v[l_] * (g[kGravity] - (shaped_ ? v[a_] * v[l_] : 0.0)));
  }
  [[nodiscard]] double ratio(const Values& v, const Givens& g) const {
    if (!shaped_) return g[kMoment] / g[kAxial];
    const double mass_kg = mass_.known ? g[kMass] : mass_of_moment(v, g);
    return (g[kMoment] + mass_kg * v[l_] * v[l_]) / g[kAxial];
  }
  [[nodiscard]] Given given_ratio() const {
    return of([=, this](const Values& v, const Givens& g) { return ratio(v, g); });
  }
  void add_ratio(const Given& value, const char* note) const {
    add(fit_, "I_over_Is", "1", value, note);
  }
  void add_spin(const Given& value, const char* note) const {
    add(fit_, "omega_s_rad_s", "rad/s", value, note);
  }

  void by_mark() const {
    const Given seen = of([=, this](const Values& v, const Givens&) { return v[omega_] / v[b_]; });
    add_ratio(seen, "omega_s / b, the spin from the mark");
    if (moment_.known && axial_.known)
      contradict(given_ratio(), seen, "the given I / Is and omega_s / b by the mark", fit_);
  }
  void by_moments() const {
    add_ratio(given_ratio(), "from the given I and Is");
    const Given turned =
        of([=, this](const Values& v, const Givens& g) { return v[b_] * ratio(v, g); });
    const bool both =
        spin_.known &&
        !contradict(turned, spin_, "b I / Is and the spin as [fit] prior has it", fit_);
    if (both)
      add_spin(combined(turned, spin_),
               "b I / Is with the given I and Is, and the spin as [fit] prior has it");
    else
      add_spin(turned, "b I / Is with the given I and Is");
  }
  void by_spin() const {
    add_ratio(of([=, this](const Values& v, const Givens& g) { return g[kSpin] / v[b_]; }),
              "omega_s / b, the spin as [fit] prior has it");
  }
  // Per unit mass; about the pivot I = A + m l^2 with the fitted l.
  void by_shape() const {
    data::Body unit = body_;
    unit.mass_kg = 1.0;
    unit.I_kg_m2.reset();
    unit.Is_kg_m2.reset();
    const auto of_shape = [=, this](const Values& v, const Givens& g) {
      data::Body body = unit;
      // A prior may reach beyond what a body can be.
      constexpr double kLeast_m = 1e-9;
      body.radius_m = std::max(g[kRadius], kLeast_m);
      body.inner_radius_m = std::clamp(g[kInner], 0.0, body.radius_m);
      body.thickness_m = std::max(g[kThickness], 0.0);
      const model::CentralInertia inertia = model::central_inertia(body);
      return (inertia.transverse_kg_m2 + v[l_] * v[l_]) / inertia.axial_kg_m2;
    };
    add_ratio(of(of_shape), "from the body's shape and the fitted l");
    add_spin(of([=, this](const Values& v, const Givens& g) { return v[b_] * of_shape(v, g); }),
             "b I / Is, I / Is from the body's shape and the fitted l");
  }

  int seen_in_;  // the arc in which a mark shows the spin; -1: none does
  Propagation propagate_;
  data::Fit& fit_;
  data::Body body_;
  bool shaped_;
  int a_, b_, l_, omega_;  // places among the parameters
  Given moment_, axial_, mass_, gravity_, spin_, radius_, inner_radius_, thickness_;
};

}  // namespace

void add_derived_top(const Problem& problem, const Eigen::VectorXd& u,
                     const Eigen::MatrixXd& covariance, const data::Scene& scene, data::Fit& fit) {
  const DerivedTop top(problem, u, covariance, scene, fit);
  top.add_ratio_and_spin();
  top.add_mass();
}

bool spin_follows(const data::Scene& scene) {
  const data::Body body = scene.body.value_or(data::Body{});
  return has_shape(scene) || (given(scene, "I_kg_m2", body.I_kg_m2).known &&
                              given(scene, "Is_kg_m2", body.Is_kg_m2).known);
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
