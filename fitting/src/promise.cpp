#include "promise.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "adequacy.hpp"
#include "first_guess.hpp"
#include "linearise.hpp"
#include "observed.hpp"
#include "prepare.hpp"
#include "problem.hpp"
#include "statistics.hpp"
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
    u = problem.start();
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
    if (parameter.prior)
      all.residuals[row++] = (value - parameter.prior->value) / parameter.prior->sigma;
    at.nothing[i] = -value / slope;
    at.positive[i] =
        is_loss(problem, parameter) && problem.predictor->parameters()[parameter.index].logarithmic;
  }
  at.jacobian = std::move(all.jacobian);
  at.residuals = std::move(all.residuals);
  return at;
}

// Chi-square when all parameters but these have done what they can, which are zero or held.
double least(const Tangent& at, const std::set<int>& zero, const std::set<int>& held) {
  Eigen::VectorXd residuals = at.residuals;
  for (const int i : zero) residuals += at.nothing[i] * at.jacobian.col(i);
  std::vector<int> columns;
  for (int i = 0; i < at.nothing.size(); ++i)
    if (!zero.contains(i) && !held.contains(i)) columns.push_back(i);
  const Eigen::MatrixXd active = at.jacobian(Eigen::all, columns);
  const Eigen::VectorXd step = active.colPivHouseholderQr().solve(-residuals);
  // Where some would be negative, one of them at least is zero: chi-square falls on a straight way
  // from any other place to here.
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t c = 0; c < columns.size(); ++c) {
    const int i = columns[c];
    if (!at.positive[i] || step[static_cast<Eigen::Index>(c)] >= at.nothing[i]) continue;
    std::set<int> fewer = zero;
    fewer.insert(i);
    best = std::min(best, least(at, fewer, held));
  }
  return std::isfinite(best) ? best : (residuals + active * step).squaredNorm();
}

std::set<int> named(const Problem& problem, const std::set<std::string>& names) {
  std::set<int> indices;
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i)
    if (names.contains(problem.name(i))) indices.insert(i);
  return indices;
}

}  // namespace

Promise promised(std::span<const data::Track> tracks, const data::Scene& scene,
                 const FitOptions& options, const std::set<std::string>& further,
                 const std::map<int, std::set<std::string>>& others) {
  const Minimum minimum(tracks, scene, options);
  const Problem& problem = minimum.problem;
  const Tangent at = tangent(problem, minimum.u);
  std::set<int> held;  // as in a fit
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i)
    if (problem.free[i].held) held.insert(i);
  const std::set<int> added = named(problem, further);
  const auto more = static_cast<int>(added.size());
  Promise promise;
  promise.rows = problem.rows();
  promise.before = least(at, added, held);
  promise.with = {least(at, {}, held), more};
  for (const auto& [key, names] : others) {
    const std::set<int> removed = named(problem, names);
    promise.instead[key] = {least(at, removed, held), more - static_cast<int>(removed.size())};
  }
  return promise;
}

double dilution(std::span<const data::Track> tracks, const data::Scene& scene,
                const FitOptions& options) {
  const Minimum at(tracks, scene, options);
  const double widened = uncertainty(at.problem, at.u).widened;
  return widened * widened;
}

void doubt_if_drifting(std::span<const data::Track> tracks, const data::Scene& scene,
                       const FitOptions& options, data::Fit& fit) {
  const Minimum at(tracks, scene, options);
  doubt_if_drifting(at.problem, uncertainty(at.problem, at.u), fit);
}

}  // namespace trochoid::fitting
