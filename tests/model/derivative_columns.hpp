#pragma once
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "trochoid/model/predictor.hpp"

namespace trochoid::model {

/// Derivatives of all that is predicted, and of the state at the end, with respect to one
/// parameter.
struct DerivativeColumn {
  std::string parameter;
  Eigen::VectorXd ours, differences;

  [[nodiscard]] double error() const { return (ours - differences).cwiseAbs().maxCoeff(); }
  [[nodiscard]] double size() const { return differences.cwiseAbs().maxCoeff(); }
};

/// Those of every parameter beside central differences of order 6.
/// @param step of a difference, as a share of the parameter's value or, of small ones, of 0.01.
inline std::vector<DerivativeColumn> derivative_columns(const Predictor& predictor,
                                                        const Eigen::VectorXd& at,
                                                        PredictRequest request, double step) {
  request.tolerance = 1e-14;
  request.want_end_state = true;
  request.derivatives.clear();
  for (int i = 0; i < at.size(); ++i) request.derivatives.push_back(i);
  const Prediction exact = predictor.predict(at, request);
  request.derivatives.clear();
  std::vector<DerivativeColumn> columns;
  for (int i = 0; i < at.size(); ++i) {
    const double h = step * std::max(std::abs(at[i]), 1e-2);
    const auto moved = [&](double steps) {
      Eigen::VectorXd values = at;
      values[i] += steps * h;
      const Prediction run = predictor.predict(values, request);
      Eigen::VectorXd all(run.values.size() + run.end_state.size());
      all << run.values, run.end_state;
      return all;
    };
    DerivativeColumn column{.parameter = predictor.parameters()[static_cast<std::size_t>(i)].name,
                            .ours = {},
                            .differences = (45.0 * (moved(1) - moved(-1)) -
                                            9.0 * (moved(2) - moved(-2)) + moved(3) - moved(-3)) /
                                           (60.0 * h)};
    column.ours.resize(column.differences.size());
    column.ours << exact.jacobian.col(i), exact.end_state_jacobian.col(i);
    columns.push_back(std::move(column));
  }
  return columns;
}

}  // namespace trochoid::model
