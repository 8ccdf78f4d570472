#include "problem/linearise.hpp"

#include "trochoid/data/error.hpp"

namespace trochoid::fitting {

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
  for (int i = 0; i < count; ++i)
    if (problem.free[i].prior) all.jacobian(first++, i) = 1.0 / problem.free[i].prior->sigma;
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

}  // namespace trochoid::fitting
