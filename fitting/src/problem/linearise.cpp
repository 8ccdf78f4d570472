#include "problem/linearise.hpp"

#include <algorithm>

#include "observe/decompositions.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::fitting {
namespace {

bool is_among(const std::vector<int>& places, int i) {
  return std::find(places.begin(), places.end(), i) != places.end();
}

// A kept parameter's prior must widen the others' error bars, while the data must not tighten that
// prior: of its column only what the others' columns span is left.
void project_on_others(const std::vector<int>& kept, Linearised& all) {
  std::vector<int> others;
  for (int i = 0; i < static_cast<int>(all.jacobian.cols()); ++i)
    if (!is_among(kept, i)) others.push_back(i);
  if (others.empty()) {
    for (const int i : kept) all.jacobian.col(i).setZero();
    return;
  }
  Eigen::MatrixXd rest = all.jacobian(Eigen::all, others);
  rest.array().rowwise() /= rest.colwise().norm().array().max(1e-300);
  const NearestLeastSquares span(rest);
  for (const int i : kept) all.jacobian.col(i) = rest * span.solve(all.jacobian.col(i));
}

}  // namespace

std::vector<int> kept_parameters(const Problem& problem) {
  const auto& infos = problem.predictor->parameters();
  std::vector<int> kept;
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i)
    if (const FreeParameter& parameter = problem.free[i];
        parameter.held && parameter.prior &&
        infos[parameter.index].role == model::ParameterInfo::Role::observation)
      kept.push_back(i);
  return kept;
}

Linearised linearise(const Problem& problem, const Eigen::VectorXd& u) {
  const int count = static_cast<int>(problem.free.size());
  int priors = 0;
  for (const FreeParameter& p : problem.free) priors += p.prior.has_value();
  Linearised all;
  all.jacobian.setZero(problem.rows() + priors, count);
  all.residuals.setZero(all.jacobian.rows());
  all.channel.assign(all.jacobian.rows(), Channel::position);
  all.arc.assign(all.jacobian.rows(), -1);
  int first = 0;
  for (int arc = 0; arc < static_cast<int>(problem.arcs.size()); ++arc) {
    Eigen::VectorXd r;
    Eigen::MatrixXd j;
    if (!evaluate(problem, arc, u, r, &j))
      throw NumericalError("the model has no prediction at the solution");
    const std::vector<int> columns = problem.columns_of(arc);
    for (std::size_t c = 0; c < columns.size(); ++c)
      all.jacobian.col(columns[c]).segment(first, r.size()) =
          j.col(c) / problem.free[columns[c]].transform.slope(u[columns[c]]);
    all.residuals.segment(first, r.size()) = r;
    for (const Reading& reading : problem.arcs[arc].readings)
      for (int k = 0; k < rows_of(reading.channel); ++k) {
        all.channel[first + reading.row + k] = reading.channel;
        all.arc[first + reading.row + k] = arc;
      }
    first += static_cast<int>(r.size());
  }
  const std::vector<int> kept = kept_parameters(problem);
  const auto put_priors = [&](bool of_kept) {
    int row = first;
    for (int i = 0; i < count; ++i) {
      if (!problem.free[i].prior) continue;
      if (is_among(kept, i) == of_kept) all.jacobian(row, i) = 1.0 / problem.free[i].prior->sigma;
      ++row;
    }
  };
  put_priors(false);
  if (kept.empty()) return all;
  project_on_others(kept, all);
  put_priors(true);
  return all;
}

bool all_residuals(const Problem& problem, const Eigen::VectorXd& u, Eigen::VectorXd& residuals) {
  residuals.resize(problem.rows());
  Eigen::Index first = 0;
  for (int arc = 0; arc < static_cast<int>(problem.arcs.size()); ++arc) {
    Eigen::VectorXd r;
    if (!evaluate(problem, arc, u, r, nullptr)) return false;
    residuals.segment(first, r.size()) = r;
    first += r.size();
  }
  return true;
}

Eigen::MatrixXd reachable(const Linearised& all) {
  constexpr double kSeen = 1e-9;  // below that the derivatives are rounding
  const Eigen::MatrixXd& jacobian = all.jacobian;
  const Eigen::VectorXd sizes = jacobian.colwise().norm().cwiseMax(1e-300);
  const Eigen::Index rank = std::min(jacobian.rows(), jacobian.cols());
  const Reflections reflections(jacobian * sizes.cwiseInverse().asDiagonal());
  const Axes axes = left_singular(reflections.triangle());
  const auto seen = (axes.values.array() > kSeen * axes.values[0]).count();
  Eigen::MatrixXd basis = Eigen::MatrixXd::Zero(jacobian.rows(), seen);
  basis.topRows(rank) = axes.directions.leftCols(seen);
  return reflections.turned(basis);
}

}  // namespace trochoid::fitting
