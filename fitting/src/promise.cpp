#include "promise.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <vector>

#include "first_guess.hpp"
#include "observed.hpp"
#include "prepare.hpp"
#include "problem.hpp"
#include "statistics.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::fitting {
namespace {

// Residuals and derivatives by u at the minimum, where further losses are next to nothing.
struct Tangent {
  Eigen::VectorXd residuals;
  Eigen::MatrixXd jacobian;
};

Eigen::MatrixXd side_by_side(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  Eigen::MatrixXd both(a.rows(), a.cols() + b.cols());
  both << a, b;
  return both;
}

// Chi-square when these columns have done what they can.
double least(const Eigen::MatrixXd& columns, const Eigen::VectorXd& residuals) {
  return (residuals - columns * columns.colPivHouseholderQr().solve(residuals)).squaredNorm();
}

// What would be added: its columns, and which of them can only grow from nothing.
struct Further {
  Eigen::MatrixXd columns;
  std::vector<bool> only_grows;
};

// The same with one of the further columns, or all.
double least_with(const Eigen::MatrixXd& columns, const Further& further,
                  const Eigen::VectorXd& residuals) {
  double best = least(columns, residuals);
  const auto take = [&](Eigen::Index first, Eigen::Index count) {
    const Eigen::MatrixXd all = side_by_side(columns, further.columns.middleCols(first, count));
    const Eigen::VectorXd step = all.colPivHouseholderQr().solve(-residuals);
    for (Eigen::Index i = 0; i < count; ++i)
      if (further.only_grows[static_cast<std::size_t>(first + i)] && step[columns.cols() + i] < 0.0)
        return;
    best = std::min(best, (residuals + all * step).squaredNorm());
  };
  const Eigen::Index all = further.columns.cols();
  for (Eigen::Index i = 0; i < all; ++i) take(i, 1);
  take(0, all);
  return best;
}

std::vector<int> indices_of(const Problem& problem, const std::set<std::string>& names) {
  std::vector<int> indices;
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i)
    if (names.contains(problem.name(i))) indices.push_back(i);
  return indices;
}

std::vector<int> all_but(const Problem& problem, const std::set<std::string>& a,
                         const std::set<std::string>& b = {}) {
  std::vector<int> indices;
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i)
    if (!a.contains(problem.name(i)) && !b.contains(problem.name(i))) indices.push_back(i);
  return indices;
}

// How many times less than its change of chi-square tells what leaves residuals hanging together.
double dilution(Problem problem, const std::set<std::string>& further) {
  std::erase_if(problem.free, [&](const FreeParameter& parameter) {
    return further.contains(problem.predictor->parameters()[parameter.index].name);
  });
  const double widened = uncertainty(problem, problem.start()).widened;
  return widened * widened;
}

}  // namespace

Promise promised(std::span<const data::Track> tracks, const data::Scene& given,
                 const FitOptions& options, const std::set<std::string>& further,
                 const std::map<int, std::set<std::string>>& others) {
  data::Scene scene = completed(given, options);
  const auto plain = model::make_predictor(scene);
  const auto wrapped = observed(*plain, scene, frame_time_s(tracks));
  Problem problem = prepare(tracks, wrapped ? *wrapped : *plain, scene, options);
  if (problem.arcs.size() > 1) return {};
  const Eigen::VectorXd u = problem.start();
  reweight(problem, u, true);
  Tangent at;
  if (!evaluate(problem, 0, u, at.residuals, &at.jacobian)) return {};
  Further added;
  for (const int i : indices_of(problem, further)) {
    const Transform::Kind kind = problem.free[i].transform.kind;
    added.only_grows.push_back(kind != Transform::Kind::identity && kind != Transform::Kind::below);
  }
  added.columns = at.jacobian(Eigen::all, indices_of(problem, further));
  const Eigen::MatrixXd known = at.jacobian(Eigen::all, all_but(problem, further));
  Promise promise;
  promise.dilution = dilution(problem, further);
  promise.rows = problem.rows();
  promise.further = static_cast<int>(added.columns.cols());
  promise.before = least(known, at.residuals);
  promise.with = least_with(known, added, at.residuals);
  for (const auto& [key, names] : others) {
    // Losses act in proportion to their strengths.
    Eigen::VectorXd without = at.residuals;
    for (const int i : indices_of(problem, names))
      without -= problem.value(i, u) / problem.free[i].transform.slope(u[i]) * at.jacobian.col(i);
    const Eigen::MatrixXd rest = at.jacobian(Eigen::all, all_but(problem, further, names));
    promise.instead[key] = least_with(rest, added, without);
  }
  return promise;
}

}  // namespace trochoid::fitting
