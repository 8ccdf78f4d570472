#include "choose/score_test.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "judge/adequacy.hpp"
#include "judge/first_guess.hpp"
#include "judge/second_thoughts.hpp"
#include "judge/statistics.hpp"
#include "observe/decompositions.hpp"
#include "observe/observed.hpp"
#include "problem/linearise.hpp"
#include "problem/prepare.hpp"
#include "problem/problem.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::fitting {
namespace {

// A minimum, whose values are the problem's start.
struct Minimum {
  std::unique_ptr<model::Predictor> plain, wrapped;
  Problem problem;
  Eigen::VectorXd u;

  Minimum(std::span<const data::Track> tracks, const data::Scene& given,
          const FitOptions& options) {
    data::Scene scene = completed(given, options);
    plain = model::make_predictor(scene);
    wrapped = observed(*plain, scene, frame_time_s(tracks));
    problem = prepare(tracks, wrapped ? *wrapped : *plain, scene, options);
    u = problem.here();
    reweight(problem, u, true);
  }
};

// Residuals and derivatives by u, priors among them.
struct Tangent {
  Eigen::MatrixXd jacobian;
  Eigen::VectorXd residuals;
  Eigen::VectorXd nothing;     // the step at which a parameter is zero: losses act in proportion
  std::vector<bool> positive;  // strengths of losses
};

Tangent tangent(const Problem& problem, const Eigen::VectorXd& u) {
  const auto count = static_cast<int>(problem.free.size());
  Linearised all = linearise(problem, u);
  Tangent at{{}, {}, Eigen::VectorXd(count), std::vector<bool>(problem.free.size())};
  Eigen::Index row = problem.rows();
  for (int i = 0; i < count; ++i) {
    const FreeParameter& parameter = problem.free[i];
    const double slope = parameter.transform.slope(u[i]), value = problem.value(i, u);
    all.jacobian.col(i) *= slope;
    if (parameter.prior) all.residuals[row++] = off_prior(*parameter.prior, value, parameter.turns);
    at.nothing[i] = -value / slope;
    at.positive[i] =
        is_loss(problem, parameter) && problem.predictor->parameters()[parameter.index].logarithmic;
  }
  at.jacobian = std::move(all.jacobian);
  at.residuals = std::move(all.residuals);
  return at;
}

// The same in as few rows as there are columns and one.
Tangent condensed(Tangent at) {
  const Eigen::Index columns = at.jacobian.cols();
  if (at.jacobian.rows() <= columns + 1) return at;
  Eigen::MatrixXd both(at.jacobian.rows(), columns + 1);
  both << at.jacobian, at.residuals;
  const Eigen::MatrixXd upper = Reflections(both).triangle();
  at.jacobian = upper.leftCols(columns);
  at.residuals = upper.col(columns);
  return at;
}

// The least chi-square on the tangent plane, and the step to it.
struct Least {
  double chi2 = std::numeric_limits<double>::infinity();
  Eigen::VectorXd step;
};

std::vector<int> all_but(const Tangent& at, const std::set<int>& zero, const std::set<int>& held) {
  std::vector<int> columns;
  for (int i = 0; i < at.nothing.size(); ++i)
    if (!zero.contains(i) && !held.contains(i)) columns.push_back(i);
  return columns;
}

using Known = std::map<std::set<int>, Least>;  // by what is zero

Least find_least(const Tangent& at, const std::set<int>& zero, const std::set<int>& held,
                 Known& known);

// The least chi-square over all parameters that are neither zero nor held.
const Least& least(const Tangent& at, const std::set<int>& zero, const std::set<int>& held,
                   Known& known) {
  const auto found = known.find(zero);
  if (found != known.end()) return found->second;
  Least least = find_least(at, zero, held, known);
  return known.emplace(zero, std::move(least)).first->second;
}

Least find_least(const Tangent& at, const std::set<int>& zero, const std::set<int>& held,
                 Known& known) {
  Eigen::VectorXd residuals = at.residuals;
  for (const int i : zero) residuals += at.nothing[i] * at.jacobian.col(i);
  const std::vector<int> columns = all_but(at, zero, held);
  const Eigen::MatrixXd active = at.jacobian(Eigen::all, columns);
  const Eigen::VectorXd step = LeastSquares(active).solve(-residuals);
  // Where some would be negative, one of them at least is zero: chi-square falls on a straight way
  // from any other place to here.
  Least best;
  for (std::size_t c = 0; c < columns.size(); ++c) {
    const int i = columns[c];
    if (!at.positive[i] || step[static_cast<Eigen::Index>(c)] >= at.nothing[i]) continue;
    std::set<int> fewer = zero;
    fewer.insert(i);
    const Least& other = least(at, fewer, held, known);
    if (other.chi2 < best.chi2) best = other;
  }
  if (std::isfinite(best.chi2)) return best;
  best.chi2 = (residuals + active * step).squaredNorm();
  best.step = Eigen::VectorXd::Zero(at.nothing.size());
  for (std::size_t c = 0; c < columns.size(); ++c)
    best.step[columns[c]] = step[static_cast<Eigen::Index>(c)];
  for (const int i : zero) best.step[i] = at.nothing[i];
  return best;
}

// Variance of each parameter when these are zero or held, which have none; none of any where the
// data do not tell some of the others apart.
Eigen::VectorXd variances(const Tangent& at, const std::set<int>& zero, const std::set<int>& held) {
  const std::vector<int> columns = all_but(at, zero, held);
  Eigen::MatrixXd active = at.jacobian(Eigen::all, columns);
  const Eigen::VectorXd size = active.colwise().norm().cwiseMax(1e-300);
  active = active * size.cwiseInverse().asDiagonal();
  Eigen::VectorXd variance = Eigen::VectorXd::Zero(at.nothing.size());
  constexpr double kApart = 1e-9;  // as in the error bars of a fit
  if (LeastSquares(active).rank(kApart) < active.cols()) return variance;
  const Eigen::MatrixXd inverse =
      SymmetricEquations(active.transpose() * active)
          .solve_each(Eigen::MatrixXd::Identity(active.cols(), active.cols()));
  variance(columns) = inverse.diagonal().cwiseMax(0.0).cwiseQuotient(size.cwiseAbs2());
  return variance;
}

// What losses that are added do to the error bars of the other parameters: ScoreTest::Change.
struct Moved {
  double moves = 0.0;
  Eigen::VectorXd further;  // what variances grow by
  Eigen::VectorXd sigma;    // afterwards, of all parameters
};

// From where `before` are zero to where only `after` are.
Moved moved(const Tangent& at, const std::set<int>& before, const std::set<int>& after,
            const std::set<int>& held, Known& known) {
  const Least without = least(at, before, held, known), with = least(at, after, held, known);
  const Eigen::VectorXd narrow = variances(at, before, held), wide = variances(at, after, held);
  Moved all{0.0, Eigen::VectorXd::Zero(narrow.size()), wide.cwiseSqrt()};
  constexpr double kOpen = std::numeric_limits<double>::infinity();
  if (wide.isZero(0.0)) all.sigma.setConstant(kOpen);
  for (int i = 0; i < narrow.size(); ++i) {
    if (!(narrow[i] > 0.0)) continue;
    const double shift = with.step[i] - without.step[i];
    all.further[i] = std::max(0.0, wide[i] - narrow[i]);
    all.moves = std::max(all.moves, (shift * shift + all.further[i]) / narrow[i]);
  }
  all.moves = std::sqrt(all.moves);
  return all;
}

// A value within its parameter's range: where the step to it ends beyond, half the way there. A
// loss is let act at least a little.
double within_range(const FreeParameter& parameter, const model::ParameterInfo& info, bool loss,
                    double now, double value) {
  constexpr double kNext = 1e-3;  // of the given value: losses act in proportion
  if (loss && info.logarithmic) return std::max(value, kNext * std::abs(parameter.given));
  if (!(value > info.lower)) return 0.5 * (now + info.lower);
  if (!(value < info.upper)) return 0.5 * (now + info.upper);
  return value;
}

// A step's values by name.
std::map<std::string, double> values_after(const Problem& problem, const Eigen::VectorXd& u,
                                           const Eigen::VectorXd& step,
                                           const std::set<int>& removed) {
  std::map<std::string, double> values;
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i) {
    if (removed.contains(i)) continue;
    const FreeParameter& parameter = problem.free[i];
    const double now = problem.value(i, u);
    values[problem.name(i)] = within_range(
        parameter, problem.predictor->parameters()[parameter.index], is_loss(problem, parameter),
        now, now + parameter.transform.slope(u[i]) * step[i]);
  }
  return values;
}

std::set<int> named(const Problem& problem, const std::set<std::string>& names) {
  std::set<int> indices;
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i)
    if (names.contains(problem.name(i))) indices.insert(i);
  return indices;
}

}  // namespace

ScoreTest score_test(std::span<const data::Track> tracks, const data::Scene& scene,
                     const FitOptions& options, const std::set<std::string>& further,
                     const std::map<int, std::set<std::string>>& others) {
  const Minimum minimum(tracks, scene, options);
  const Problem& problem = minimum.problem;
  const Tangent at = condensed(tangent(problem, minimum.u));
  Known known;
  std::set<int> held;  // as in a fit
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i)
    if (problem.free[i].held) held.insert(i);
  const std::set<int> added = named(problem, further);
  const auto more = static_cast<int>(added.size());
  ScoreTest test;
  test.rows = problem.rows();
  test.before = least(at, added, held, known).chi2;
  const auto change = [&](const std::set<int>& removed) {
    const Least& to = least(at, removed, held, known);
    const bool larger = removed.size() < added.size() &&
                        std::includes(added.begin(), added.end(), removed.begin(), removed.end());
    ScoreTest::Change to_there{to.chi2, more - static_cast<int>(removed.size()),
                               values_after(problem, minimum.u, to.step, removed)};
    if (!larger) return to_there;
    const Moved by = moved(at, added, removed, held, known);
    to_there.moves = by.moves;
    for (int i = 0; i < by.further.size(); ++i) {
      const double slope = std::abs(problem.free[i].transform.slope(minimum.u[i]));
      if (added.contains(i))
        to_there.sigmas[problem.name(i)] = slope * by.sigma[i];
      else
        to_there.further[problem.name(i)] = slope * slope * by.further[i];
    }
    return to_there;
  };
  for (const auto& [key, names] : others) test.instead[key] = change(named(problem, names));
  return test;
}

double variance_inflation(std::span<const data::Track> tracks, const data::Scene& scene,
                          const FitOptions& options) {
  const Minimum at(tracks, scene, options);
  const double widened = uncertainty(at.problem, at.u).widened;
  return widened * widened;
}

namespace {

// An error bar may have been widened beyond all that a parameter can be. Of a loss or a friction
// that rivals do without the bar says enough.
void tell_open(const Problem& problem, const Eigen::VectorXd& u, data::Fit& fit) {
  constexpr double kFarBeyond = 3.0;  // a spin near nothing may be as uncertain as it is large
  std::vector<std::string> open;
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i) {
    const std::string name = problem.name(i);
    const auto parameter =
        std::find_if(fit.parameters.begin(), fit.parameters.end(),
                     [&](const data::FitParameter& p) { return p.name == name; });
    const bool coefficient =
        is_loss(problem, problem.free[i]) || name == "friction" || name == kSlipScale;
    if (parameter == fit.parameters.end() || !parameter->identifiable || coefficient ||
        parameter->status != data::ParameterStatus::free ||
        parameter->sigma < kFarBeyond * natural_size(problem, i, u))
      continue;
    parameter->identifiable = false;
    open.push_back(parameter->name);
  }
  if (open.empty() || !says_explained(fit)) return;
  const bool first = fit.verdict != data::FitVerdict::weak;
  fit.verdict = data::FitVerdict::weak;
  fit.verdict_words +=
      fmt::format("{}{}", first ? "; not determined: " : ", ", fmt::join(open, ", "));
}

}  // namespace

void doubt_as_a_whole(std::span<const data::Track> tracks, const data::Scene& scene,
                      const FitOptions& options, data::Fit& fit) {
  const Minimum at(tracks, scene, options);
  tell_open(at.problem, at.u, fit);
  doubt_as_a_whole(at.problem, at.u, uncertainty(at.problem, at.u), scene.fit, fit);
}

}  // namespace trochoid::fitting
